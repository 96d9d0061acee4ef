# SPDX-License-Identifier: Apache-2.0
"""The plan that `slambed run NAME` would follow now, without creating any sequence, input, mask
or image."""

from slambed.campaign.datasets import must_be_made
from slambed.campaign.plan import Files, Plan, check, make_plan, masks_asked, repetitions
from slambed.campaign.prepared_inputs import kept_input
from slambed.errors import SlambedError
from slambed.files.yaml_source import YamlSource
from slambed.native import SIMULATION
from slambed.spec.device import VIRTUAL
from slambed.spec.experiment import Experiment
from slambed.spec.library import Library
from slambed.spec.software import host_software


def plan_as_it_is(
    experiment: Experiment,
    source: YamlSource,
    library: Library,
    engine: str | None = None,
    runs: int | None = None,
) -> Plan:
    """Returns the plan with the experiment's own engine and number of runs per cell, or those
    given.

    Raises SlambedError for a mistake in the file, for a missing input that the run keys depend on,
    and for an engine that this host refuses.
    """
    asked = engine or experiment.engine
    count = repetitions(experiment, runs)
    files = (experiment, source, library, check(experiment, source, library, asked))
    for name in experiment.datasets:
        if must_be_made(name):
            raise SlambedError(f"dataset {name} is not prepared")
    if asked == VIRTUAL:
        return _virtual(files, count)
    # Importing containers and links takes 0.5 s, which virtual runs do not need.
    from slambed.campaign.live_plan import as_it_is

    return as_it_is(files, asked, count)


def _virtual(files: Files, count: int) -> Plan:
    experiment, _, library, _ = files
    if masks_asked(experiment, library):
        raise SlambedError("its runs need masks of its sequences, which may have to be made")
    return make_plan(
        *files,
        VIRTUAL,
        host_software(program=SIMULATION),
        count,
        lambda name: kept_input(name, library).file,
    )
