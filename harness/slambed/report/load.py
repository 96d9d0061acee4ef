# SPDX-License-Identifier: Apache-2.0
"""Loads a results folder; damaged, missing or unknown files become lines in `problems`."""

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from slambed.data.stand_in import played_instead
from slambed.data.trajectory import Trajectory, read_tum
from slambed.errors import SlambedError
from slambed.files.json_file import object_or_empty
from slambed.metrics.catalog import SUMMARY_KEYS, metric, metrics_of
from slambed.metrics.collect import events_file, events_today, stored_log
from slambed.metrics.declared import described_by
from slambed.metrics.events import EventLog
from slambed.metrics.metric import Metric
from slambed.metrics.summary import Summary
from slambed.records.manifest import Manifest
from slambed.report.board_facts import COLUMNS as BOARD
from slambed.report.board_facts import board_facts
from slambed.report.busy_host import held_up, waited
from slambed.report.link_stalls import stalled_links
from slambed.report.metrics_versions import REMEDY, old_version, own_metrics_in, refused_runs
from slambed.report.own_programs import program_fact
from slambed.spec.experiment import DEVICE_PACE

MOST_PROBLEMS_PER_KIND = 10
"""Further problems of the same kind are only counted."""
MANIFEST_FACTS = (
    "commit", "dirty", "image_id", "sequence_checksum", "kernel", "cpu_model", "cores", "command",
)  # fmt: skip
"""Facts that should be equal in all runs of an experiment; the report shows where they differ."""


Row = dict[str, object]


@dataclass(repr=False)
class Results:
    """All runs of one experiment. `runs` has one row per run; its columns are the summary keys,
    `label`, `plain_label` (without the engine), `host` (null without a hosts file), those of
    `board_facts`, `program` (packages and files of a system with its own), `params.<name>`,
    `plan.<paper>`, `started_utc`, `folder` and `described` (key of the system's description)."""

    folder: Path
    title: str
    runs: pd.DataFrame
    problems: list[str] = field(default_factory=list)
    facts: dict[str, Counter[str]] = field(default_factory=dict)
    """Counts the runs by value of each manifest fact."""
    facts_of: dict[str, dict[str, str]] = field(default_factory=dict)
    """Manifest facts of each run, by its key."""
    limits: pd.DataFrame = field(default_factory=pd.DataFrame)
    expected: int | None = None
    """Runs the experiment asks for, when known."""
    spec: dict[str, Any] = field(default_factory=dict)
    """The experiment file as run, if it was stored."""
    links: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Name of a link profile -> its content as played."""
    stand_ins: list[str] = field(default_factory=list)
    """Which sequences were used instead of the requested ones, one line each."""
    refused: list[str] = field(default_factory=list)
    """Runs whose numbers must not be mixed with the others'; they count as invalid."""

    def __repr__(self) -> str:
        systems = self.runs["label"].nunique() if "label" in self.runs else 0
        valid = len(self.valid_runs) if "valid" in self.runs else 0
        return (
            f"Results({str(self.folder)!r}, experiment={self.name!r}, systems={systems}, "
            f"runs={len(self.runs)}, valid={valid})"
        )

    @property
    def name(self) -> str:
        """Returns the experiment's id."""
        return self.folder.name

    @property
    def valid_runs(self) -> pd.DataFrame:
        return self.runs[self.runs["valid"].eq(True)]

    @cached_property
    def own_metrics(self) -> dict[str, Metric]:
        """Returns the systems' own metrics by key."""
        return own_metrics_in(self.runs)

    def metric(self, key: str) -> Metric:
        return metric(key, self.own_metrics)

    def numbers(self) -> list[str]:
        """Returns the columns that are numeric metrics."""
        own = [*SUMMARY_KEYS, *self.own_metrics]
        return [key for key in own if key in self.runs and self.metric(key).is_number]

    def cells(self) -> list[str]:
        """Returns the cells in the order of the experiment file, else of first appearance."""
        return list(dict.fromkeys(self.runs["cell"]))

    def run_dir(self, run_key: str) -> Path:
        return self.folder / "runs" / run_key

    def table(self, run_key: str, name: str) -> pd.DataFrame | None:
        """Returns `events`, `samples` or `link` of one run; None if the file is missing or (with a
        problem) unreadable."""
        path = self.run_dir(run_key) / f"{name}.parquet"
        if not path.exists():
            return None
        try:
            table = pd.DataFrame(pq.read_table(path).to_pandas())
        except (OSError, pa.ArrowException) as error:
            self.complain(f"{run_key}/{path.name}: unreadable ({str(error).splitlines()[0]})")
            return None
        return events_today(table) if name == "events" else table

    def events(self, run_key: str, kinds: tuple[str, ...]) -> EventLog | None:
        """Returns the stored events of these types; None if they were not kept or (with a problem)
        are unreadable."""
        path = events_file(self.run_dir(run_key), kinds)
        if path is None:
            return None
        log = stored_log(path, kinds)
        for line in log.problems:
            self.complain(f"{run_key}/{line}")
        return None if log.problems else log

    def trajectory(self, run_key: str, name: str = "trajectory.txt") -> Trajectory | None:
        return self._trajectory(self.run_dir(run_key) / name)

    def groundtruth(self, dataset: str) -> Trajectory | None:
        """Returns the ground truth of a dataset, stored with the runs."""
        return self._trajectory(self.groundtruth_file(dataset))

    def groundtruth_file(self, dataset: str) -> Path:
        return self.folder / "groundtruth" / f"{dataset.replace('/', '_')}.txt"

    def _trajectory(self, path: Path) -> Trajectory | None:
        if not path.exists():
            return None
        try:
            found = read_tum(path)
        except SlambedError as error:
            self.complain(str(error))
            return None
        return found if len(found) else None

    def only(self, keep: list[bool]) -> "Results":
        """Returns the results with only some of the runs."""
        runs = self.runs[pd.Series(keep, index=self.runs.index, dtype=bool)]
        counted: dict[str, Counter[str]] = {name: Counter() for name in self.facts}
        for key in runs["run_key"]:
            for name, value in self.facts_of.get(str(key), {}).items():
                counted[name][value] += 1
        return replace(self, runs=runs, facts=counted)

    def complain(self, line: str) -> None:
        """Adds a problem unless it is already there."""
        if line not in self.problems:
            self.problems.append(line)


def load(folder: Path) -> Results:
    """Reads every run of `results/<experiment>`.

    Raises SlambedError if the folder does not exist; an empty one gives no runs and a problem.
    """
    if not folder.is_dir():
        raise SlambedError(f"no results, {folder} is not a folder, run the experiment first")
    problems: list[str] = []
    experiment = object_or_empty(folder / "experiment.json", problems, needed=True)
    listed = experiment.get("runs")
    planned = [r for r in listed if isinstance(r, dict)] if isinstance(listed, list) else []
    rows, facts_of, limits = _read_runs(folder, planned, problems)
    facts: dict[str, Counter[str]] = {name: Counter() for name in MANIFEST_FACTS}
    for own in facts_of.values():
        for name, value in own.items():
            facts[name][value] += 1
    columns = [*SUMMARY_KEYS, "label", "plain_label", "host", *BOARD, "started_utc", "folder"]
    runs = pd.DataFrame(rows, columns=None if rows else columns)
    for name in columns:
        if name not in runs:
            runs[name] = None
    spec = experiment.get("experiment")
    spec = spec if isinstance(spec, dict) else {}
    if not len(runs):
        problems.insert(0, "nothing was measured: there is no readable run")
    title = str(spec.get("title") or experiment.get("title") or folder.name)
    results = Results(
        folder=folder,
        title=title,
        stand_ins=_stand_ins(experiment),
        runs=_side_by_side(_in_order(runs, spec)),
        problems=problems,
        facts=facts,
        facts_of=facts_of,
        limits=pd.DataFrame(limits),
        expected=len(planned) or None,
        spec=spec,
        links=_links(planned),
    )
    _refuse_mixtures(results)
    _report_missing(results, planned)
    runs = results.valid_runs

    def samples(run_key: str) -> pd.DataFrame | None:
        return results.table(run_key, "samples")

    for lines in (held_up(runs), waited(runs, samples), stalled_links(runs)):
        for line in islice(lines, MOST_PROBLEMS_PER_KIND):
            results.complain(line)
    return results


def _refuse_mixtures(results: Results) -> None:
    """Invalidates runs whose metrics version or ground truth differs from the others'."""
    runs = results.runs
    truths = {str(d): results.groundtruth_file(str(d)) for d in runs["dataset"].dropna().unique()}
    refused = refused_runs(runs, truths)
    results.refused = list(refused)
    remedy = REMEDY.format(name=results.name)
    for reason, count in Counter(refused.values()).items():
        results.complain(f"{count} of {len(runs)} runs are left out: {reason}; {remedy}")
    if refused:
        out = runs["run_key"].isin(results.refused)
        runs.loc[out, "valid"] = False
        runs.loc[out, "invalid_reason"] = runs.loc[out, "run_key"].map(refused)
    elif (version := old_version(runs)) is not None:
        results.complain(f"all numbers are of metrics version {version}; {remedy}")


def _read_runs(
    folder: Path, planned: list[dict[str, Any]], problems: list[str]
) -> tuple[list[Row], dict[str, dict[str, str]], list[Row]]:
    facts: dict[str, dict[str, str]] = {}
    rows: list[Row] = []
    limits: list[Row] = []
    kinds: Counter[str] = Counter()
    wanted = {str(run.get("run_key")): run for run in planned}

    def note_problem(kind: str, line: str) -> None:
        kinds[kind] += 1
        if kinds[kind] <= MOST_PROBLEMS_PER_KIND:
            problems.append(line)

    runs_dir = folder / "runs"
    names = sorted(runs_dir.iterdir()) if runs_dir.is_dir() else []
    for path in names:
        if not path.is_dir():
            note_problem("foreign", f"runs/{path.name}: not a run folder, ignored")
            continue
        summary = Summary.read(path / "summary.json")
        if not summary or not isinstance(summary.get("cell"), str):
            there = (path / "summary.json").exists()
            what = "summary.json is incomplete or not from slambed" if there else "no summary.json"
            note_problem("torn", f"runs/{path.name}: {what}, run ignored")
            continue
        manifest = Manifest.read(path / "manifest.json") or Manifest()
        if not manifest.model_fields_set:
            note_problem(
                "manifest",
                f"runs/{path.name}: no readable manifest.json: host, commit and plan unknown",
            )
        spec = manifest.kept
        found_by = described_by(summary.text("system"), spec.system_folder)
        known = metrics_of(found_by)
        unknown = sorted(set(summary) - {item.key for item in known})
        if unknown:
            note_problem(
                "keys", f"runs/{path.name}: unknown keys in summary.json: {', '.join(unknown)}"
            )
        row, wrong = _typed(summary, known)
        if wrong:
            note_problem(
                "types", f"runs/{path.name}: values of the wrong type, dropped: {', '.join(wrong)}"
            )
        row["run_key"] = path.name
        # The run may have been executed for another experiment under other names.
        called = wanted.get(path.name, {})
        row |= {key: called[key] for key in ("experiment", "cell") if called.get(key)}
        label = called.get("label") or spec.label or _label_of(row)
        row |= {
            "label": label,
            "plain_label": label,
            "host": manifest.host.name if manifest.host else None,
            "started_utc": manifest.started_utc,
            "folder": path.name,
            "described": found_by,
        }
        row |= board_facts(manifest) | program_fact(manifest) | _plans_of(manifest)
        for name, value in (spec.params or {}).items():
            row[f"params.{name}"] = value
        if wanted and path.name not in wanted:
            note_problem(
                "old", f"runs/{path.name}: not in the last plan of the experiment, shown too"
            )
        for warning in manifest.warnings or []:
            note_problem("warnings", f"runs/{path.name}: {warning}")
        known_facts = {name: getattr(manifest, name) for name in MANIFEST_FACTS}
        facts[path.name] = {name: _fact(x) for name, x in known_facts.items() if x is not None}
        limits += _limits_of(row, manifest)
        rows.append(row)
    for kind, count in kinds.items():
        if count > MOST_PROBLEMS_PER_KIND:
            problems.append(f"... and {count - MOST_PROBLEMS_PER_KIND} more of this kind ({kind})")
    return rows, facts, limits


def _plans_of(manifest: Manifest) -> dict[str, str | None]:
    """Returns `plan.<paper>`, `plan_frozen.<paper>` and `plan_commit.<paper>`, as registered when
    the run was executed."""
    found: dict[str, str | None] = {}
    for paper, digests in (manifest.plans or {}).items():
        found[f"plan.{paper}"] = digests.plan
        found[f"plan_frozen.{paper}"] = digests.frozen
        if digests.commit is not None:
            found[f"plan_commit.{paper}"] = digests.commit
    return found


def _limits_of(row: Row, manifest: Manifest) -> list[Row]:
    """Returns requested and granted limits of each node, with its throttling."""
    found: list[Row] = []
    for node, limits in (manifest.limits or {}).items():
        throttling = (manifest.throttling or {}).get(node)
        found.append(
            {
                "run_key": row["run_key"],
                "cell": row["cell"],
                "host": row["host"],
                "node": node,
                "device": row["device_mobile"] if node == "mobile" else row["device_edge"],
                "asked": _fact(limits.asked and limits.asked.as_json()),
                "granted": _fact(limits.granted and limits.granted.as_json()),
                "throttled_s": None if throttling is None else throttling.throttled_s,
            }
        )
    return found


def _label_of(row: Row) -> str:
    variant = row.get("variant")
    return f"{row['system']}:{variant}" if variant not in (None, "default") else str(row["system"])


def _fact(value: object) -> str:
    if isinstance(value, list):
        return " ".join(str(item) for item in value)
    if isinstance(value, dict):
        return ", ".join(f"{k} {v}" for k, v in value.items() if v is not None)
    return str(value)


def _typed(summary: Summary, known: tuple[Metric, ...]) -> tuple[Row, list[str]]:
    """Returns the known keys; a value of the wrong type counts as not measured."""
    wrong = [item.key for item in known if not item.accepts(summary.get(item.key))]
    return {i.key: None if i.key in wrong else summary.get(i.key) for i in known}, wrong


def _in_order(runs: pd.DataFrame, spec: dict[str, Any]) -> pd.DataFrame:
    """Sorts runs by dataset, profile and label in the order of the experiment file, then by
    engine and repetition, so that compared runs are adjacent."""
    if not len(runs):
        return runs
    keys = pd.DataFrame(
        {
            "dataset": runs["dataset"].map(_rank(_names(spec.get("datasets"), "id"))),
            "profile": runs["profile"].map(_rank(_profile_names(spec))),
            "label": runs["label"].map(_rank(_names(spec.get("systems"), "label", "system"))),
            "cell": runs["cell"].map(_rank([])),
            "engine": runs["engine"],
            "repetition": runs["repetition"],
        }
    )
    order = keys.sort_values(list(keys.columns), kind="stable").index
    return runs.loc[order].reset_index(drop=True)


def _side_by_side(runs: pd.DataFrame) -> pd.DataFrame:
    """Makes runs of several engines, or live runs of several paces, separate systems by adding
    these to their names. Live and virtual numbers are never pooled."""
    if runs["engine"].nunique() < 2 and runs["pace"].nunique() < 2:
        return runs
    paced = runs["pace"].eq(DEVICE_PACE).map({True: ", device's pace", False: ""})
    suffix = " (" + runs["engine"].astype(str) + paced + ")"
    return runs.assign(label=runs["label"] + suffix, cell=runs["cell"] + suffix)


def _links(planned: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    for run in planned:
        link = run.get("link")
        if isinstance(link, dict) and isinstance(link.get("content"), dict):
            found.setdefault(str(link.get("profile")), link["content"])
    return found


def _profile_names(spec: dict[str, Any]) -> list[str]:
    link = spec.get("link")
    return _names(link.get("profiles"), "name", "profile") if isinstance(link, dict) else []


def _names(items: object, *keys: str) -> list[str]:
    """Returns the names of a YAML list whose items are names, or objects with a name under one of
    `keys`."""
    found: list[str] = []
    for item in items if isinstance(items, list) else []:
        if isinstance(item, dict):
            name = next((item[key] for key in keys if item.get(key)), "")
            variant = item.get("variant")
            found.append(f"{name}:{variant}" if variant and not item.get("label") else str(name))
        else:
            found.append(str(item))
    return found


Rank = tuple[int, tuple[tuple[float, str], ...]]


def _rank(names: list[str]) -> Callable[[object], Rank]:
    """Returns a sort key: the position in the list, then other names, such as those of a grid, by
    their numbers and letters: rtt_40 before rtt_160."""
    position = {name: index for index, name in enumerate(names)}

    def rank(value: object) -> Rank:
        text = "" if value is None or value != value else str(value)
        return position.get(text, len(position) if text else -1), _parts(text)

    return rank


def _parts(text: str) -> tuple[tuple[float, str], ...]:
    """Returns numbers and the text between them, to compare names part by part."""
    parts = re.split(r"(\d+(?:\.\d+)?)", text)
    return tuple((float(p), "") if i % 2 else (-1.0, p) for i, p in enumerate(parts))


def _stand_ins(experiment: dict[str, Any]) -> list[str]:
    """Returns which sequences were used instead of the requested ones, one line each."""
    found, names = experiment.get("stand_ins"), experiment.get("datasets")
    pairs = found.items() if isinstance(found, dict) else ()
    asked = names if isinstance(names, dict) else {}
    return [
        played_instead(
            str(used), str(wanted), " and ".join(n for n, led_to in asked.items() if led_to == used)
        )
        for used, wanted in pairs
    ]


def _report_missing(results: Results, planned: list[dict[str, Any]]) -> None:
    there = set(results.runs["run_key"])
    missing = Counter(str(r.get("cell")) for r in planned if r.get("run_key") not in there)
    for cell, count in list(missing.items())[:MOST_PROBLEMS_PER_KIND]:
        results.complain(f"{cell}: {count} runs missing")
    if len(missing) > MOST_PROBLEMS_PER_KIND:
        results.complain(
            f"... and {len(missing) - MOST_PROBLEMS_PER_KIND} more combinations with gaps"
        )
