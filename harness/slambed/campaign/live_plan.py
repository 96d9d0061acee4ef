# SPDX-License-Identifier: Apache-2.0
"""The plan of live runs on this host: for a campaign, which has locked the host, and for a
preview, which works alongside another campaign."""

from collections.abc import Callable

from rich.console import Console

from slambed.campaign.boards import look_at_board
from slambed.campaign.choose import choose_engine
from slambed.campaign.foreign import software_of_foreign
from slambed.campaign.plan import Files, Plan, Provider, make_plan
from slambed.campaign.prepared_inputs import kept_input
from slambed.engines.base import Engine
from slambed.errors import SlambedError
from slambed.spec.board import Board


def plan_of(
    files: Files,
    engine: Engine,
    software: str,
    count: int,
    provide: Provider,
    notify: Callable[[str], None] | None,
    board: Board | None,
) -> Plan:
    """Returns the plan of runs on this engine. With `notify`, missing Python packages of systems
    are installed."""
    experiment, _, library, _ = files
    foreign = software_of_foreign(experiment, library, engine, software, notify)
    return make_plan(
        *files,
        engine.name,
        software,
        count,
        provide,
        foreign=foreign,
        notify=notify or (lambda line: None),
        board=board,
    )


def look_ahead(
    files: Files,
    asked: str,
    count: int,
    provide: Provider,
    console: Console,
    notify: Callable[[str], None] | None,
) -> Plan:
    """Returns the plan without taking host or board: builds no image and cleans nothing.
    Sequences, inputs and, with `notify`, Python packages that run keys depend on are created if
    they are missing."""
    engine, software = choose_engine(asked, console, build=None)
    roles = files[0].roles
    board = None if roles is None else look_at_board(roles.mobile)
    return plan_of(files, engine, software, count, provide, notify, board)


def as_it_is(files: Files, asked: str, count: int) -> Plan:
    """Returns the plan from existing inputs. Raises SlambedError if one would have to be
    created."""
    library = files[2]
    return look_ahead(
        files,
        asked,
        count,
        lambda name: kept_input(name, library).file,
        Console(quiet=True),
        notify=None,
    )


def without_making(files: Files, asked: str, count: int) -> Plan | None:
    """Returns the plan from existing inputs, or None; the campaign reports the error once it has
    the host."""
    try:
        return as_it_is(files, asked, count)
    except SlambedError:
        return None
