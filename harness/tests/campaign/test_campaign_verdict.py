# SPDX-License-Identifier: Apache-2.0
"""Exit code of a command that executed runs: the worst outcome of its campaigns."""

from pathlib import Path

import pytest

from slambed.campaign.runner import CampaignOutcome
from slambed.commands.run_and_report import raise_unless_good
from slambed.errors import ExitCode, SlambedError

GOOD = CampaignOutcome(done=3, valid=3)


def test_campaigns_that_ended_well_are_no_error() -> None:
    raise_unless_good([GOOD, CampaignOutcome()], "quickstart")


@pytest.mark.parametrize(
    ("verdict", "line"),
    [
        (
            CampaignOutcome(done=2, valid=2, given_up={"a1": "the disk is full"}),
            "1 runs have no result: the disk is full",
        ),
        (CampaignOutcome(done=4, valid=3), "1 of 7 runs are invalid; 'slambed status x' says"),
        (CampaignOutcome(done=4, valid=4, not_completed=2), "2 of 7 runs did not complete"),
        (
            CampaignOutcome(done=4, valid=2, not_completed=1, given_up={"a1": "no room"}),
            "1 runs have no result: no room",
        ),
    ],
)
def test_one_that_did_not_is_reported_after_all_have_run(
    verdict: CampaignOutcome, line: str
) -> None:
    """Also for a paper's experiments: a failing one among good ones gives exit code 1."""
    with pytest.raises(SlambedError, match=line) as ended:
        raise_unless_good([GOOD, verdict], "x")
    assert ended.value.code == ExitCode.NOT_ALL_GOOD


def test_the_command_that_says_why_names_the_results_folder() -> None:
    with pytest.raises(SlambedError, match=r"'slambed status x --results /elsewhere' says why"):
        raise_unless_good([CampaignOutcome(done=2, valid=1)], "x", Path("/elsewhere"))
