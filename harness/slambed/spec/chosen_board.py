# SPDX-License-Identifier: Apache-2.0
"""Which board executes the mobile nodes of an experiment, and what boards do not support."""

from collections.abc import Mapping

from slambed.errors import SlambedError
from slambed.files.yaml_source import Location, YamlSource
from slambed.spec.board import Board
from slambed.spec.device import VIRTUAL
from slambed.spec.experiment import DEVICE_PACE, Experiment, has_cuts
from slambed.spec.system import Scalar, System


def chosen_board(
    experiment: Experiment, source: YamlSource, engine: str, seen: Board | None
) -> Board | None:
    """Returns the board of the mobile nodes, with the facts in `seen` once it has been
    contacted. Raises a complaint about options that a board does not support."""
    if experiment.roles is None:
        return None
    place: Location = ("roles", "mobile")
    name = experiment.roles.mobile.called
    if engine == VIRTUAL:
        raise source.complaint(
            f"a mobile node on board {name} runs live, not on engine virtual", place
        )
    if experiment.pace == DEVICE_PACE:
        raise source.complaint(f"board {name} has its own pace, not a device's", ("pace",))
    if has_cuts(experiment):
        raise source.complaint(f"nobody can cut the network to board {name}", ("faults",))
    return seen or Board(name=name)


def must_go_to_board(system: System, params: Mapping[str, Scalar], board: Board) -> None:
    """Raises SlambedError for a system whose mobile node cannot run on a board."""
    if system.runtime is not None:
        raise SlambedError(
            f"system {system.name} is a program of its own, which board {board.name} cannot "
            "execute yet"
        )
    if params.get("rtt_source") == "profile":
        raise SlambedError(
            f"rtt_source: profile asks for the RTT of an emulated link, but to board {board.name} "
            "there is a real one; write rtt_source: tcp_info"
        )
