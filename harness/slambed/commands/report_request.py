# SPDX-License-Identifier: Apache-2.0
"""Checks the names in an experiment's report section before anything runs."""

from collections.abc import Iterable

from slambed.files.yaml_source import Location, YamlSource
from slambed.metrics.catalog import numbers_of, own_of
from slambed.papers.published import read_papers
from slambed.spec.experiment import Experiment
from slambed.suggestion import suggestion

FIGURES = (
    "losses", "trajectory", "rtt", "cpu", "memory", "stages", "losses_by_profile", "tradeoff",
    "changes", "sweep",
)  # fmt: skip
"""Figures that do not belong to a single metric."""


def check_figure_names(experiment: Experiment, source: YamlSource) -> None:
    """Raises SlambedError for an unknown metric, plot or published number."""
    report = experiment.report
    own = own_of(choice.system for choice in experiment.systems).values()
    numbers = numbers_of(own)
    # `faults` is text rather than a number, but tables show it, so a report may name it.
    _known("metric", report.metrics, [*numbers, "faults"], source, ("report", "metrics"))
    _known("plot", report.plots, [*FIGURES, *numbers], source, ("report", "plots"))
    if experiment.reproduces:
        published = {name for paper in read_papers() for name in paper.names()}
        _known("published number", experiment.reproduces, published, source, ("reproduces",))


def _known(
    what: str, names: list[str], known: Iterable[str], source: YamlSource, place: Location
) -> None:
    for index, name in enumerate(names):
        if name not in known:
            advice = suggestion(name, known)
            raise source.complaint(f"unknown {what} '{name}'", (*place, index), advice)
