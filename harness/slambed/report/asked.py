# SPDX-License-Identifier: Apache-2.0
"""What an experiment asks of its report by name, checked before anything runs."""

from collections.abc import Iterable

from slambed.metrics.run import SUMMARY_KEYS
from slambed.report.catalog import FIGURES
from slambed.report.load import TEXT_KEYS
from slambed.report.papers import read_papers
from slambed.spec.experiment import Experiment
from slambed.spec.yaml_source import Location, YamlSource, suggestion

NUMBERS = [key for key in SUMMARY_KEYS if key not in TEXT_KEYS]


def check_asked(experiment: Experiment, source: YamlSource) -> None:
    """Raises SlambedError for a metric, a plot or a published number that nobody knows."""
    report = experiment.report
    # Faults are words, shown wherever there were any: asking for them is no mistake.
    _known("metric", report.metrics, [*NUMBERS, "faults"], source, ("report", "metrics"))
    _known("plot", report.plots, [*FIGURES, *NUMBERS], source, ("report", "plots"))
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
