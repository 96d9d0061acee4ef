# SPDX-License-Identifier: Apache-2.0
"""The known datasets, the locations of their sources, and their prepared form."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path

from slambed.data import places
from slambed.data.cache import SequenceCache, open_or_none
from slambed.data.fetch import shown
from slambed.data.preparation import Notify, Progress, SourceJob, SynthJob
from slambed.data.prepared import SEQUENCE_FILE, PreparedSequence
from slambed.data.readers import ReaderOptions, SequenceReader, load_reader
from slambed.data.readers.base import FolderReader
from slambed.data.recipe import UNVERIFIED, Dataset, split_pattern
from slambed.data.recipe_file import DATASET_FILE, dataset_files, dataset_name, load_recipe
from slambed.errors import MissingDataError, SlambedError
from slambed.files.outputs import is_file, resolved
from slambed.native import left_behind, repository_root
from slambed.suggestion import did_you_mean

YAML = (".yaml", ".yml")


@dataclass(frozen=True)
class Catalog:
    """All dataset files of the checkout and of the user's folders, and the folders that are
    searched for sources."""

    datasets: dict[str, Dataset]
    search: tuple[Path, ...]
    folder: Path
    """Folder of the dataset files; their relative path files are resolved against it."""
    broken: dict[str, SlambedError] = field(default_factory=dict)
    """File without suffix -> its error, which does not affect requests for other datasets."""
    files: dict[str, Path] = field(default_factory=dict)
    """Id or alias -> its file."""
    ambiguous: dict[str, SlambedError] = field(default_factory=dict)
    """Ids that both the checkout and a user's file define, so that a request is ambiguous."""

    @classmethod
    def load(cls, folder: Path | None = None, search: list[Path] | None = None) -> Catalog:
        """Reads catalog/datasets/*.yaml of the checkout (or of another folder), and the dataset
        files in the folders of $SLAMBED_DATASETS."""
        folder = folder or repository_root() / "catalog" / "datasets"
        searched = search if search is not None else places.search_path()
        catalog = cls({}, tuple(searched), folder)
        own = [file for place in places.dataset_folders() for file in dataset_files(place)]
        for file in (*sorted(folder.glob("*.yaml")), *own):
            try:
                catalog._add(file)
            except SlambedError as error:
                catalog.broken[dataset_name(file)] = error
        return catalog

    def _add(self, file: Path) -> Dataset:
        """Adds a file. Raises SlambedError if it is unreadable or its names are taken."""
        dataset = load_recipe(file)
        names = dict.fromkeys((dataset.id, *dataset.aliases), file)
        if taken := names.keys() & self.files.keys():
            name = min(taken)
            error = SlambedError(
                f"{file}: '{name}' is already taken by {self.files[name]}; give it another id"
            )
            if not self._is_ours(file) and self._is_ours(self.files[name]):
                self.ambiguous[name] = error
            raise error
        self.files.update(names)
        self.datasets[dataset.id] = dataset
        return dataset

    def _is_ours(self, file: Path) -> bool:
        return file.parent == self.folder

    def get(self, name: str) -> Dataset:
        """Returns the dataset with this id or alias, or of this file."""
        if name.endswith(YAML):
            return self._of_file(resolved(Path(name)))
        if (error := self.ambiguous.get(name)) is not None:
            raise error
        for dataset in self.datasets.values():
            if name == dataset.id or name in dataset.aliases:
                return dataset
        if (error := self.broken.get(name)) is not None:
            raise error
        if moved := left_behind(self.folder / f"{name}.yaml"):
            raise SlambedError(f"dataset '{name}' is not known; {moved}")
        known = [n for d in self.datasets.values() for n in (d.id, *d.aliases)]
        unread = f" ({', '.join(self.broken)} cannot be read)" if self.broken else ""
        raise SlambedError(
            f"dataset '{name}' is not known{did_you_mean(name, known)}; "
            f"'slambed data list' shows all{unread}"
        )

    def _of_file(self, file: Path) -> Dataset:
        """Adds a file, and the dataset files next to it that it refers to."""
        for name, known in self.files.items():
            if resolved(known) == file:
                return self.get(name)
        if not is_file(file):
            raise SlambedError(f"there is no dataset file {file}")
        dataset = self._add(file)
        for name in (*dataset.first_of, *filter(None, [dataset.window_of])):
            beside = (file.parent / f"{name}.yaml", file.parent / name / DATASET_FILE)
            if name not in self.files and (found := [p for p in beside if is_file(p)]):
                self._of_file(found[0])
        return dataset

    def resolve(
        self, name: str, cache_dir: Path | None = None, within: tuple[str, ...] = ()
    ) -> Dataset:
        """Like get, but resolves a `first_of` to its first available choice; `within` are those
        that lead here."""
        dataset = self.get(name)
        if not dataset.first_of:
            return dataset
        path = (*within, dataset.id)
        if dataset.id in within:
            raise SlambedError(
                f"dataset '{dataset.id}': first_of leads back to it ({' -> '.join(path)}); leave "
                "one of them out"
            )
        choices = [
            self.resolve(self._named_by(dataset, choice), cache_dir, path)
            for choice in dataset.first_of
        ]
        return next((c for c in choices if self.available(c, cache_dir)), choices[-1])

    def stands_in_for(self, name: str, cache_dir: Path | None = None) -> Dataset | None:
        """Returns the first choice of a `first_of` if it is not available; otherwise None."""
        dataset = self.get(name)
        if not dataset.first_of:
            return None
        wanted = self.get(self._named_by(dataset, dataset.first_of[0]))
        return None if self.resolve(name, cache_dir).id == wanted.id else wanted

    def _named_by(self, dataset: Dataset, name: str) -> str:
        """Returns the name of another dataset in a dataset file; that of a file is relative to
        it."""
        return str(self._home(dataset) / name) if name.endswith(YAML) else name

    def original(self, dataset: Dataset) -> Dataset:
        """Returns the recording that somebody has to get: the first choice of a `first_of`, the
        whole of a part; any other dataset is returned unchanged."""
        if dataset.first_of:
            self.resolve(dataset.id)  # raises where a choice leads back here
            return self.original(self.get(self._named_by(dataset, dataset.first_of[0])))
        return self.whole(dataset)

    def available(self, dataset: Dataset, cache_dir: Path | None = None) -> bool:
        """Returns whether prepare would find the source."""
        dataset = self.whole(dataset)
        if dataset.synthetic:
            wanted = dataset.synthetic.path_file
            return wanted is None or self._find_path_file(dataset, wanted) is not None
        if self.locate(dataset) is not None:
            return True
        return SequenceCache(places.prepared_folder(cache_dir)).find(dataset) is not None

    def whole(self, dataset: Dataset) -> Dataset:
        """Returns the sequence that a window is part of; any other dataset is returned
        unchanged."""
        if dataset.window_of is None:
            return dataset
        whole = self.get(self._named_by(dataset, dataset.window_of))
        if whole.id == dataset.id:
            raise SlambedError(
                f"dataset '{dataset.id}': window_of leads back to itself; name the dataset that it "
                "is a part of"
            )
        if whole.first_of or whole.window_of:
            raise SlambedError(
                f"dataset '{dataset.id}': window_of {whole.id}, which is no sequence of its own; "
                "name the one that it leads to"
            )
        if "sensor" in dataset.model_fields_set and dataset.sensor != whole.sensor:
            raise SlambedError(
                f"dataset '{dataset.id}': sensor {dataset.sensor}, but it is a part of {whole.id}, "
                f"which is {whole.sensor}; remove sensor"
            )
        return whole

    def locate(self, dataset: Dataset) -> Path | None:
        """Returns the source on the search path or next to the user's dataset file; None if it
        is missing."""
        return next(iter(self._located(dataset)), None)

    def _located(self, dataset: Dataset) -> list[Path]:
        """Returns all matches of the first successful pattern in one folder: the parts of one
        recording."""
        for folder, pattern in self._looked_for(dataset):
            # A name with brackets is a pattern, too.
            as_named = [folder / pattern] if places.exists(folder / pattern) else []
            if found := as_named or sorted(folder.glob(pattern), key=in_reading_order):
                return found
        return []

    def _looked_for(self, dataset: Dataset) -> list[tuple[Path, str]]:
        """Returns the start folders and patterns of the source, in the order of the search."""
        splits = [split_pattern(pattern) for pattern in dataset.paths]
        named = [(folder, rest) for folder, rest in splits if folder is not None]
        searched = [
            (folder, rest)
            for folder in self._looked_in(dataset)
            for own, rest in splits
            if own is None
        ]
        return named + searched

    def _path_file(self, dataset: Dataset) -> Path | None:
        """Returns the trajectory file of a generated dataset that follows a recorded path."""
        assert dataset.synthetic is not None
        wanted = dataset.synthetic.path_file
        if wanted is None:
            return None
        if (file := self._find_path_file(dataset, wanted)) is not None:
            return file
        raise MissingDataError(
            f"dataset '{dataset.id}' follows the camera path {wanted}, which is not in "
            f"{self._folders(dataset)}; put it there or set SLAMBED_DATA"
        )

    def _find_path_file(self, dataset: Dataset, wanted: str) -> Path | None:
        """Searches next to the dataset files first, so that the path is the same on every
        machine; then like other data."""
        folders = [self._home(dataset), *self._looked_in(dataset)]
        return next((f / wanted for f in folders if is_file(f / wanted)), None)

    def _home(self, dataset: Dataset) -> Path:
        """Returns the folder of the dataset's file."""
        return self.files[dataset.id].parent if dataset.id in self.files else self.folder

    def _places(self, dataset: Dataset) -> list[Path]:
        """Returns the candidate folders of the source; for a user's file this includes its own
        folder."""
        home = self._home(dataset)
        return [*([] if home == self.folder else [home]), *self.search]

    def _looked_in(self, dataset: Dataset) -> list[Path]:
        """Returns the candidate folders that exist and are readable."""
        return [folder for folder in self._places(dataset) if places.is_open(folder)]

    def _folders(self, dataset: Dataset) -> str:
        return ":".join(str(folder) for folder in self._places(dataset))

    def prepare(
        self,
        name: str,
        cache_dir: Path | None = None,
        progress: Progress | None = None,
        notify: Notify = lambda line: None,
    ) -> PreparedSequence:
        """Returns the prepared sequence of a dataset; prepares it now if it is not in the cache.

        Two processes never prepare the same dataset concurrently; `notify` is called before
        waiting. An interrupt leaves no partial sequence.
        """
        dataset = self.whole(self.resolve(name, cache_dir))
        cache = SequenceCache(places.prepared_folder(cache_dir))
        if dataset.synthetic is not None:
            return cache.get(dataset, SynthJob(dataset, self._path_file(dataset)), progress, notify)
        source = self.locate(dataset)
        if source is None:
            if (kept := cache.find(dataset)) is not None:
                missing = self._not_found(dataset)
                notify(f"note: {missing}; the sequence prepared from it before is played")
                return PreparedSequence.open(kept)
            raise MissingDataError(self._missing(dataset))
        if is_file(source / SEQUENCE_FILE):
            return PreparedSequence.open(source)
        reader = open_source(dataset, *self._located(dataset))
        return cache.get(dataset, SourceJob(dataset, reader), progress, notify)

    def prepared(self, name: str, cache_dir: Path | None = None) -> PreparedSequence | None:
        """Returns the sequence that `prepare` would open without creating it; None if it would
        have to, as where a kept one is damaged."""
        dataset = self.whole(self.resolve(name, cache_dir))
        source = self.locate(dataset)
        if source is not None and is_file(source / SEQUENCE_FILE):
            return PreparedSequence.open(source)
        kept = SequenceCache(places.prepared_folder(cache_dir)).find(dataset)
        if kept is None:
            return None
        again = source is not None or dataset.synthetic is not None
        return open_or_none(kept) if again else PreparedSequence.open(kept)

    def must_be_here(self, name: str, cache_dir: Path | None = None) -> None:
        """Raises the error of `prepare` for a missing dataset, without preparing it."""
        dataset = self.whole(self.resolve(name, cache_dir))
        if self.available(dataset, cache_dir):
            return
        if dataset.synthetic is not None:
            self._path_file(dataset)
        raise MissingDataError(self._missing(dataset))

    def _missing(self, dataset: Dataset) -> str:
        recipe = "no download recipe"
        if (download := dataset.download) is not None:
            size = f"{download.size_bytes / 1e6:.0f} MB" if download.size_bytes else "size unknown"
            checked = "checksum " + (UNVERIFIED if not download.verified else download.sha256[:12])
            recipe = f"get it from {shown(download.url)} ({size}, {checked})"
        return f"{self._not_found(dataset)}; {recipe}, or set SLAMBED_DATA"

    def _not_found(self, dataset: Dataset) -> str:
        looked_for = [str(folder / pattern) for folder, pattern in self._looked_for(dataset)]
        if dead := next(filter(os.path.islink, looked_for), None):
            return f"dataset '{dataset.id}' not found: {dead} is a link to nothing"
        wanted = " or ".join(dataset.paths)
        return f"dataset '{dataset.id}' not found: no {wanted} in {self._folders(dataset)}"


def in_reading_order(path: Path) -> list[tuple[int, str]]:
    """Sort key for the numbered parts of a recording: `_9` before `_10`."""
    pieces = re.split(r"(\d+)", str(path))
    return [(int(piece), "") if piece.isdecimal() else (-1, piece) for piece in pieces]


def open_source(dataset: Dataset, source: Path, *more: Path) -> SequenceReader:
    """Returns the reader of a recorded dataset; `more` are further matches of its pattern: the
    other parts of a split bag."""
    assert dataset.reader is not None
    camera = dataset.camera
    options = ReaderOptions(
        sensor=dataset.sensor,
        size=(camera.width, camera.height) if camera else None,
        camera=camera.camera() if camera else None,
        distortion=camera.distortion if camera else (),
        depth_unit_m=dataset.depth_unit_m,
        fps=dataset.fps,
        groundtruth=dataset.groundtruth,
        further_parts=more,
        extra=dataset.reader_options,
    )
    try:
        reader = load_reader(dataset.reader)
    except SlambedError as unknown:
        raise SlambedError(f"dataset '{dataset.id}': {unknown}") from None
    _must_fit(reader, dataset, source)
    return reader(source, options)


def _must_fit(reader: type[SequenceReader], dataset: Dataset, source: Path) -> None:
    """Raises SlambedError for a source or a recipe that this reader cannot use."""
    if not places.exists(source):
        raise SlambedError(f"dataset '{dataset.id}': {source} is a link to nothing; correct it")
    if issubclass(reader, FolderReader) and is_file(source):
        raise SlambedError(
            f"dataset '{dataset.id}': {source} is a file, but {dataset.reader} reads folders; name "
            "the folder in paths"
        )
    # A format with its own calibration refuses another one.
    if dataset.camera is None and reader.takes_distortion:
        keys = ", ".join(f"{key}: ..." for key in ("width", "height", "fx", "fy", "cx", "cy", "bf"))
        raise SlambedError(
            f"dataset '{dataset.id}': {dataset.reader} brings no calibration; add camera: "
            f"{{{keys}}} (slambed data import-camera writes it)"
        )


def prepare(
    dataset_id: str,
    cache_dir: Path | None = None,
    progress: Progress | None = None,
    notify: Notify = lambda line: None,
) -> PreparedSequence:
    """Prepares a dataset of the checkout's catalog; the path of a prepared folder is opened
    unchanged."""
    if is_file(Path(dataset_id) / SEQUENCE_FILE):
        return PreparedSequence.open(dataset_id)
    return Catalog.load().prepare(dataset_id, cache_dir, progress, notify)
