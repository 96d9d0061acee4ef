# SPDX-License-Identifier: Apache-2.0
"""Routes addresses to pages. Addresses mirror the results folder, so that links inside a report
lead to our pages."""

import hashlib
import time
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path
from typing import Any

from slambed.campaign.campaign_state import is_alive, state_of
from slambed.errors import SlambedError
from slambed.explain.run_log import read_run
from slambed.explain.story import story
from slambed.report.overview import CAPTION
from slambed.report.page import STYLE, page_script, script_of
from slambed.report.timeline import timeline_svg
from slambed.report.told import told
from slambed.serve.answer import Answer, as_json, content, error_page, moved, page
from slambed.serve.experiment_view import LoadedExperiment, RunFilter, figures_of
from slambed.serve.experiments import ExperimentEntry, is_experiment, listed, names_of, status_of
from slambed.serve.features import NOT_HERE as NO_FEATURES
from slambed.serve.features import FeatureFiles, frame_json
from slambed.serve.guard import TYPES, file_in, report_policy
from slambed.serve.kept import PageCache, stamp_of
from slambed.serve.pictures import NOT_HERE, Pictures
from slambed.serve.run_view import RunFiles, run_json
from slambed.spec.run_spec import run_name

Query = Mapping[str, list[str]]
StampedEntry = tuple[Hashable, ExperimentEntry]
"""An entry of the list, with the stamp of the files that it was made of."""

EXPERIMENTS, PAPERS, STATIC = "experiments", "papers", "static"
OWN_SCRIPTS = ("follow.js", "run.js", "lanes.js", "space.js", "features.js")
SHARED_SCRIPTS = ("view_math.js", "figures.js", "lanes_zoom.js")
"""Scripts that reports also contain."""
OF_EXPERIMENT = ("summary.csv", "report.md", "experiment.json")
OF_RUN = ("manifest.json", "summary.json", "trajectory.txt", "trajectory_live.txt",
          "events.parquet", "samples.parquet", "link.parquet")  # fmt: skip
MOST_EXPERIMENTS, MOST_RUNS = 6, 12
"""Most entries in memory."""
A_DAY = "private, max-age=86400"


class Site:
    """The pages of one results folder; safe for use by several threads."""

    def __init__(self, results: Path) -> None:
        self.results = results
        self._loaded: PageCache[LoadedExperiment] = PageCache(MOST_EXPERIMENTS)
        self._listed: PageCache[ExperimentEntry] = PageCache(1000)
        self._runs: PageCache[dict[str, Any]] = PageCache(MOST_RUNS)
        self._pictures = Pictures()
        self._features = FeatureFiles()
        self._static = {
            "style.css": (STYLE + _own("serve.css"), "text/css; charset=utf-8"),
            **{name: (_own(name), "text/javascript; charset=utf-8") for name in OWN_SCRIPTS},
            **{n: (script_of(n), "text/javascript; charset=utf-8") for n in SHARED_SCRIPTS},
        }

    def answer(self, parts: list[str], query: Query, slash: bool) -> Answer:
        """Answers an address whose parts were checked; `slash`: the address ended with one."""
        try:
            return self._route(parts, query, slash) or _not_there()
        except SlambedError as error:
            return error_page(HTTPStatus.NOT_FOUND, f"{error}.")

    def _route(self, parts: list[str], query: Query, slash: bool) -> Answer | None:
        match parts:
            case []:
                return self._list()
            case [kind, name] if kind == STATIC and name in self._static:
                text, what = self._static[name]
                return content(text.encode(), what)
            case ["state.json"]:
                return as_json({"version": self._list_version(self._entries())})
            case [kind, *rest] if kind == PAPERS:
                return self._file(self.results / PAPERS, rest)
            case [kind, name, *rest] if kind == EXPERIMENTS and is_experiment(self.results / name):
                if not rest and not slash:
                    return moved(f"/{EXPERIMENTS}/{name}/")
                return self._of_experiment(name, rest, query, slash)
        return None

    def _of_experiment(
        self, name: str, rest: list[str], query: Query, slash: bool
    ) -> Answer | None:
        folder = self.results / name
        match rest:
            case []:
                return self._experiment(name, query)
            case ["state.json"]:
                version = self._experiment_version(self._load(name)[0], self._listed_now(name))
                return as_json({"version": version})
            case ["report", *file]:
                return self._file(folder / "report", file)
            case [file] if file in OF_EXPERIMENT:
                return self._file(folder, [file])
            case ["runs", key, *further]:
                run = self._run_folder(name, key)
                if run is None:
                    return error_page(
                        HTTPStatus.NOT_FOUND,
                        f"Experiment {name} has no run {key}; perhaps its parameters have changed "
                        "since.",
                    )
                if not further and not slash:
                    return moved(f"/{EXPERIMENTS}/{name}/runs/{key}/")
                return self._of_run(name, run, further)
        return None

    def _of_run(self, name: str, run: Path, further: list[str]) -> Answer | None:
        match further:
            case []:
                return self._run(name, run)
            case ["data.json"]:
                return as_json(self._run_data(name, run))
            case ["frames", picture] if picture.removesuffix(".jpg").isdecimal():
                return self._picture(run, int(picture.removesuffix(".jpg")))
            case ["features", frame] if frame.removesuffix(".json").isdecimal():
                return self._features_of(run, int(frame.removesuffix(".json")))
            case ["files", file] if file in OF_RUN:
                return self._file(run, [file])
        return None

    def _run_folder(self, name: str, key: str) -> Path | None:
        """Returns the resolved folder of an experiment's run; None if it is outside the results."""
        try:
            real = (self.results / name / "runs" / key).resolve(strict=True)
        except OSError:
            return None
        return real if real.is_dir() and real.is_relative_to(self.results.resolve()) else None

    def _file(self, root: Path, parts: list[str]) -> Answer | None:
        found = file_in(root, parts)
        if found is None or not found.is_relative_to(self.results.resolve()):
            return None
        kind = TYPES[found.suffix]
        scripts = [page_script()] if found.suffix == ".html" else []
        return content(found.read_bytes(), kind, report_policy(scripts))

    # The list of experiments.

    def _list(self) -> Answer:
        entries = self._entries()
        shown = [entry for _, entry in entries]
        return page(
            "serve_list.html.j2",
            folder=str(self.results),
            version=self._list_version(entries),
            experiments=sorted(shown, key=lambda item: -item.changed_s),
            has_papers=(self.results / PAPERS / "index.html").is_file(),
            when=lambda s: time.strftime("%Y-%m-%d %H:%M", time.localtime(s)),
            campaign=self._status,
        )

    def _listed_now(self, name: str) -> StampedEntry:
        """Returns the entry that a page shows, which may be older than its files, with its
        stamp."""
        make: Callable[[], ExperimentEntry] = lambda: listed(self.results, name)  # noqa: E731
        return self._listed.get(name, self._stamp(name), make)

    def _entries(self) -> list[StampedEntry]:
        return [self._listed_now(name) for name in names_of(self.results)]

    def _list_version(self, entries: list[StampedEntry]) -> str:
        return _digest([(entry.name, stamp, self._is_alive(entry)) for stamp, entry in entries])

    def _is_alive(self, entry: ExperimentEntry) -> bool:
        """Checks the process too, because a killed campaign changes no file."""
        campaign = entry.campaign
        return campaign is not None and campaign.alive and is_alive(campaign.pid, campaign.began_s)

    def _status(self, item: ExperimentEntry) -> str:
        campaign = item.campaign
        if campaign is not None and campaign.alive:  # the time left changes without its files
            campaign = state_of(self.results / item.name, time.time())
        return status_of(campaign)

    def _stamp(self, name: str) -> tuple[Any, ...]:
        """Returns a stamp that changes with the pages of an experiment."""
        folder = self.results / name
        return stamp_of(
            folder / "experiment.json",
            folder / "ledger.jsonl",
            folder / "runs",
            folder / "summary.csv",
            folder / "report" / "made_of.sha256",
            folder / "report" / "figures.json",
        )

    # One experiment.

    def _load(self, name: str) -> tuple[Hashable, LoadedExperiment]:
        folder = self.results / name
        return self._loaded.get(name, self._stamp(name), lambda: LoadedExperiment.of(folder))

    def _experiment_version(self, stamp: Hashable, listed_now: StampedEntry) -> str:
        """Returns the version of a page of runs with this stamp, and of this entry."""
        listed_stamp, entry = listed_now
        return _digest([stamp, listed_stamp, self._is_alive(entry)])

    def _experiment(self, name: str, query: Query) -> Answer:
        stamp, loaded = self._load(name)
        listed_now = self._listed_now(name)
        options = loaded.options()
        chosen = RunFilter.of_query(query, options)
        runs, more = loaded.runs(chosen)
        folder = self.results / name
        return page(
            "serve_experiment.html.j2",
            name=name,
            version=self._experiment_version(stamp, listed_now),
            title=loaded.results.title,
            campaign=self._status(listed_now[1]),
            expected=loaded.results.expected,
            there=len(loaded.results.runs),
            valid=len(loaded.results.valid_runs),
            problems=[*loaded.results.stand_ins, *loaded.results.problems],
            options=options,
            chosen=chosen,
            told=told(loaded.results),
            pictures=loaded.pictures(chosen),
            picture_caption=CAPTION,
            tables=loaded.tables(chosen),
            notes=[(cell.name, note) for cell in loaded.cells for note in cell.notes],
            runs=runs,
            more=more,
            figures=figures_of(folder),
            has_report=(folder / "report" / "index.html").is_file(),
        )

    # One run.

    def _run_data(self, name: str, run: Path) -> dict[str, Any]:
        stamp = stamp_of(run / "events.parquet", run / "summary.json", run / "trajectory.txt")
        found = RunFiles.of(run)
        sequence = self._pictures.sequence(found.manifest.sequence_checksum)
        truth = self._truth(name, found)
        features = self._features.of(found.manifest)
        key = (name, run.name, sequence is not None, features is not None)
        make: Callable[[], dict[str, Any]] = lambda: run_json(found, truth, sequence, features)  # noqa: E731
        with _not_found_if_broken():
            return self._runs.get(key, stamp, make)[1]

    def _truth(self, name: str, run: RunFiles) -> Path | None:
        dataset = run.summary.text("dataset")
        if not dataset:
            return None
        path = self.results / name / "groundtruth" / f"{dataset.replace('/', '_')}.txt"
        return path if path.is_file() else None

    def _run(self, name: str, run: Path) -> Answer:
        found = RunFiles.of(run)
        broken, lines, svg = None, [], None
        try:
            with _not_found_if_broken():
                lines = story(read_run(run))
                svg = timeline_svg(self._load(name)[1].results, run.name)
        except SlambedError as error:
            broken = str(error)
        sequence = self._pictures.sequence(found.manifest.sequence_checksum)
        features = self._features.of(found.manifest)
        return page(
            "serve_run.html.j2",
            name=name,
            key=run.name,
            title=self._run_title(name, run.name, found),
            summary=found.summary,
            broken=broken,
            story=lines,
            timeline=svg,
            no_pictures=None if sequence is not None else NOT_HERE,
            no_features=NO_FEATURES if sequence is not None and features is None else None,
            files=[file for file in OF_RUN if (run / file).is_file()],
        )

    def _run_title(self, name: str, key: str, run: RunFiles) -> str:
        rows = self._load(name)[1].results.runs
        cells = rows.loc[rows["run_key"] == key, ["cell", "repetition"]].to_dict("records")
        if cells:
            return run_name(cells[0]["cell"], cells[0]["repetition"])
        return run_name(run.manifest.cell or key, run.manifest.repetition)

    def _picture(self, run: Path, frame: int) -> Answer | None:
        checksum = RunFiles.of(run).manifest.sequence_checksum
        data = self._pictures.jpeg(checksum, frame)
        return None if data is None else content(data, "image/jpeg", cache=A_DAY)

    def _features_of(self, run: Path, frame: int) -> Answer | None:
        manifest = RunFiles.of(run).manifest
        sequence = self._pictures.sequence(manifest.sequence_checksum)
        features = self._features.of(manifest)
        if sequence is None or features is None:
            return None
        data = frame_json(features, frame, sequence)
        return None if data is None else as_json(data)


@contextmanager
def _not_found_if_broken() -> Iterator[None]:
    """Turns errors from reading a run's damaged or unknown files into SlambedError."""
    try:
        yield
    except (ValueError, KeyError, TypeError, OSError) as error:
        first = (str(error).splitlines() or [""])[0]
        line = f"its files cannot be read ({type(error).__name__}: {first})"
        raise SlambedError(line) from error


def _not_there() -> Answer:
    return error_page(HTTPStatus.NOT_FOUND, "There is no such page.")


def _own(name: str) -> str:
    return (files("slambed.serve") / "static" / name).read_text(encoding="utf-8")


def _digest(value: object) -> str:
    return hashlib.sha256(repr(value).encode()).hexdigest()[:16]
