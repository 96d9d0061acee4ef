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
    notify: Callable[[str], None],
    board: Board | None,
    make: bool = True,
) -> Plan:
    """Returns the plan of runs on this engine. With `make`, missing Python packages of systems are
    installed."""
    experiment, _, library, _ = files
    install = notify if make else None
    foreign = software_of_foreign(experiment, library, engine, software, install)
    return make_plan(
        *files, engine.name, software, count, provide, foreign=foreign, notify=notify, board=board
    )


def look_ahead(
    files: Files,
    asked: str,
    count: int,
    provide: Provider,
    console: Console,
    notify: Callable[[str], None],
    make: bool = True,
) -> Plan:
    """Returns the plan without taking host or board: builds no image and cleans nothing.
    Sequences, inputs and, with `make`, Python packages that run keys depend on are created if they
    are missing."""
    engine, software = choose_engine(asked, console, build=None)
    roles = files[0].roles
    board = None if roles is None else look_at_board(roles.mobile)
    return plan_of(files, engine, software, count, provide, notify, board, make)


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
        lambda line: None,
        make=False,
    )


def without_making(files: Files, asked: str, count: int) -> Plan | None:
    """Returns the plan from existing inputs, or None; the campaign reports the error once it has
    the host."""
    try:
        return as_it_is(files, asked, count)
    except SlambedError:
        return None
