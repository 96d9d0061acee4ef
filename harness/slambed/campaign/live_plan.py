# SPDX-License-Identifier: Apache-2.0
"""The plan of live runs on this host: as a campaign makes it, which has the host, and as one looks
ahead, beside whatever campaign has it."""

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
) -> Plan:
    """Of runs on this engine."""
    experiment, _, library, _ = files
    foreign = software_of_foreign(experiment, library, engine, software)
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
) -> Plan:
    """The plan, without taking host or board: no image is built and nothing is cleaned. What its
    keys need, sequences and inputs, is made where it is not there."""
    engine, software = choose_engine(asked, console, build=None)
    roles = files[0].roles
    board = None if roles is None else look_at_board(roles.mobile)
    return plan_of(files, engine, software, count, provide, notify, board)


def as_it_is(files: Files, asked: str, count: int) -> Plan:
    """The same from inputs that are there; SlambedError where one would have to be made."""
    library = files[2]
    return look_ahead(
        files,
        asked,
        count,
        lambda name: kept_input(name, library).file,
        Console(quiet=True),
        lambda line: None,
    )


def without_making(files: Files, asked: str, count: int) -> Plan | None:
    """The same; None where it is unknown, which whoever takes the host hears of."""
    try:
        return as_it_is(files, asked, count)
    except SlambedError:
        return None
