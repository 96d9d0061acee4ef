# SPDX-License-Identifier: Apache-2.0
"""Packs results into one file, so that another machine can continue.

A campaign of thousands of runs may outlast the machine it started on. Resuming, tables and verdicts
need only summaries and manifests, a few hundred bytes per run.
"""

import io
import tarfile
import tempfile
import zlib
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from lzma import LZMAError
from pathlib import Path, PurePosixPath

from slambed.campaign.folder import ResultFolder
from slambed.campaign.size import keys_of, plans
from slambed.campaign.store import STORE, RunStore
from slambed.errors import SlambedError, environment_error
from slambed.files.atomic import replacing
from slambed.files.json_file import object_of, read_object
from slambed.metrics.collect import SOME_EVENTS, events_file, write_some_events

NEEDED = ("manifest.json", "summary.json")
"""Files that prove that a run exists and hold all its metrics."""
UNREADABLE = (tarfile.TarError, LZMAError, zlib.error, EOFError)


@dataclass(frozen=True)
class Packed:
    """What a packed file holds."""

    runs: int
    size_bytes: int
    events: dict[str, int]
    """Number of events of each type that was asked for."""


def pack(
    results: Path, names: list[str], file: Path, whole: bool, events: Collection[str] = ()
) -> Packed:
    """Writes the valid runs in the plans of these experiments. Runs that are not whole keep only
    the `events` of these types.

    The output is reproducible: entries are sorted and have no times or owners.

    Raises SlambedError for an unknown experiment, for events that cannot be read, or if the file
    cannot be written.
    """
    named = dict(plans(results))
    if missing := [name for name in names if name not in named]:
        known = ", ".join(named) or "none"
        raise SlambedError(f"no results of {', '.join(missing)} in {results}; there are: {known}")
    store = RunStore(results)
    wanted: set[str] = set().union(*(named[name] for name in names))
    keys = [key for key in sorted(wanted) if store.state(key) == "valid"]
    counts = Counter(dict.fromkeys(events, 0))
    try:
        with replacing(file, durable=True) as partial, tarfile.open(partial, "w:xz") as out:
            for name in sorted(names):
                truths = sorted((results / name / "groundtruth").glob("*.txt"))
                for path in (results / name / "experiment.json", *truths):
                    _add(out, path, results)
            for key in keys:
                for path in _files(store.runs / key, whole):
                    _add(out, path, results)
                if events and not whole:
                    counts.update(_add_events(out, store.runs / key, events, results))
    except OSError as error:
        place = error.filename or file
        raise environment_error(f"cannot pack: {error.strerror}, {place}") from None
    return Packed(len(keys), file.stat().st_size, dict(counts))


def unpack(file: Path, results: Path) -> tuple[int, int]:
    """Adds the runs of a file to a results folder; returns the number of runs and of new ones.

    Existing valid runs and existing plans are kept. Raises SlambedError for a file that `pack` did
    not write, or a truncated one; its complete runs are kept, which the message says.
    """
    store = RunStore(results)
    store.open()
    found = new = 0
    experiments: set[str] = set()
    try:
        for place, files in _members(file):
            if place.parts[0] == STORE:
                new += _take_run(store, place.parts[1], files, file)
                found += 1
            else:
                _must_be_whole(files, place, file)
                experiments.add(place.parts[0])
                _take_experiment(results / place.parts[0], files)
    except SlambedError as error:
        if not found:
            raise
        kept = f"{found} of its runs were whole and are kept in {results}"
        raise SlambedError(f"{error}; {kept}", error.code) from None
    except OSError as error:
        raise environment_error(f"cannot write results: {error.strerror}, {results}") from None
    finally:
        store.close()
        for name, keys in plans(results):
            if name in experiments:
                (results / name / STORE).mkdir(exist_ok=True)
                ResultFolder(results / name).show(keys)
    if not found:
        raise SlambedError(f"{file} has no run in it; pack it again")
    return found, new


def extract(file: Path, folder: Path) -> int:
    """Extracts a packed file to look at, into a folder that no campaign uses; returns the number of
    runs.

    It is quicker than `unpack`, because nothing is synced to disk run by run. Raises SlambedError
    as `unpack` does.
    """
    runs = 0
    experiments = []
    try:
        for place, files in _members(file):
            runs += place.parts[0] == STORE
            if place.parts[0] != STORE:
                _must_be_whole(files, place, file)
                experiments.append(folder / place)
            for path, content in files.items():
                target = folder / place / path
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)
        for experiment in experiments:
            keys = keys_of(read_object(experiment / "experiment.json")) or set()
            (experiment / STORE).mkdir(exist_ok=True)
            for key in sorted(keys):
                if (folder / STORE / key).is_dir():
                    (experiment / STORE / key).symlink_to(Path("..") / ".." / STORE / key)
    except OSError as error:
        raise environment_error(f"cannot extract {file}: {error.strerror}, {folder}") from None
    return runs


def _files(run: Path, whole: bool) -> list[Path]:
    if not whole:
        return [run / name for name in NEEDED]
    drawn = run / "pictures"
    return sorted(p for p in run.rglob("*") if p.is_file() and not p.is_relative_to(drawn))


def _add_events(
    out: tarfile.TarFile, run: Path, types: Collection[str], root: Path
) -> dict[str, int]:
    """Adds the events of these types, and returns how many of each. A run without them, because it
    was packed before, stays without."""
    source = events_file(run, types)
    if source is None:
        return {}
    with tempfile.TemporaryDirectory(prefix="slambed-pack.") as place:
        some = Path(place) / SOME_EVENTS
        counts = write_some_events(source, types, some)
        _add_content(out, (run / SOME_EVENTS).relative_to(root).as_posix(), some.read_bytes())
    return counts


def _add(out: tarfile.TarFile, path: Path, root: Path) -> None:
    _add_content(out, path.relative_to(root).as_posix(), path.read_bytes())


def _add_content(out: tarfile.TarFile, name: str, content: bytes) -> None:
    member = tarfile.TarInfo(name)
    member.size = len(content)
    out.addfile(member, io.BytesIO(content))


Files = dict[PurePosixPath, bytes]


def _members(file: Path) -> Iterator[tuple[PurePosixPath, Files]]:
    """Yields runs and experiments: the folder of each, and its files by relative path. A folder
    is yielded after its last file was read, so never an incomplete one."""
    place, files = None, Files()
    with _readable(file) as stream:
        for member in stream:
            path = PurePosixPath(member.name)
            depth = 2 if path.parts[:1] == (STORE,) else 1
            outside = path.is_absolute() or ".." in path.parts
            if not member.isreg() or outside or len(path.parts) <= depth:
                raise SlambedError(f"{file} is no file of `slambed results pack`: {member.name!r}")
            folder = PurePosixPath(*path.parts[:depth])
            if folder != place:
                if place is not None:
                    yield place, files
                place, files = folder, {}
            content = stream.extractfile(member)
            assert content is not None
            files[path.relative_to(folder)] = content.read()
        assert stream.fileobj is not None
        while stream.fileobj.read(1 << 20):  # what is cut off at the very end is noticed here
            pass
        if place is None:
            raise SlambedError(f"{file} is no file of `slambed results pack`: nothing is in it")
        yield place, files


@contextmanager
def _readable(file: Path) -> Iterator[tarfile.TarFile]:
    try:
        with tarfile.open(file, "r:xz") as stream:
            yield stream
    except UNREADABLE as error:
        raise SlambedError(
            f"{file} is torn, or no file of `slambed results pack` ({error})"
        ) from None
    except OSError as error:
        raise SlambedError(f"cannot read {file}: {error.strerror}") from None


def _take_run(store: RunStore, key: str, files: Files, file: Path) -> bool:
    """Returns whether the run was added."""
    if missing := [name for name in NEEDED if PurePosixPath(name) not in files]:
        raise SlambedError(f"{file}: run {key} has no {missing[0]}; pack it again")
    if store.state(key) == "valid":
        return False
    assert store.work is not None
    folder = store.work / key
    _write(folder, files)
    store.put(key, folder)
    return True


def _must_be_whole(files: Files, place: PurePosixPath, file: Path) -> None:
    """Refuses a torn plan, which would block every command on the results folder."""
    plan = PurePosixPath("experiment.json")
    if plan not in files:
        raise SlambedError(f"{file} is no file of `slambed results pack`: {place} has no {plan}")
    if keys_of(object_of(files[plan])) is None:
        raise SlambedError(f"{file}: {place / plan} is not whole; pack it again")


def _take_experiment(folder: Path, files: Files) -> None:
    missing = {path: content for path, content in files.items() if not (folder / path).exists()}
    _write(folder, missing)


def _write(folder: Path, files: Files) -> None:
    for path, content in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        with replacing(folder / path) as out:
            out.write_bytes(content)
