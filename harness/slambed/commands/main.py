# SPDX-License-Identifier: Apache-2.0
"""The `slambed` command. Errors are one line; exit codes are in docs/reference/exit-codes.md."""

import errno
import os
import signal
import sys
from functools import cache
from importlib import import_module
from typing import Annotated

import typer
from typer.core import TyperGroup

from slambed import __version__
from slambed.caller import give_written_to_caller
from slambed.commands import completion
from slambed.commands.font_caches import forget_backend, settle_font_caches
from slambed.commands.older_verbs import renewed
from slambed.errors import ExitCode
from slambed.failures import INTERRUPTED, line_and_code
from slambed.process.hangup import interrupt_once
from slambed.process.standard_streams import accept_any_text, open_closed, replace_gone

app = typer.Typer(
    name="slambed",
    help="A reproducible testbed for edge-offloaded visual SLAM.",
    pretty_exceptions_enable=False,
)
COMMANDS = {
    "run": "run:run",
    "status": "status:status",
    "report": "report:report",
    "gate": "report:gate",
    "bisect": "bisect:bisect",
    "evaluate": "report:evaluate",
    "diff": "report:diff_command",
    "check-system": "own_systems:check_system",
    "new": "own_systems:new",
    "doctor": "host:doctor",
    "setup": "host:setup",
    "images": "host:images",
    "clean": "host:clean",
    "calibrate": "calibrate:calibrate",
    "explain": "explain:explain",
    "serve": "serve:serve",
    "watch": "watch:watch",
    "infer": "infer:infer",
    "data": "data:app",
    "cache": "cache:app",
    "inputs": "inputs:app",
    "masks": "masks:app",
    "results": "results:app",
    "systems": "listings:systems",
    "devices": "listings:devices",
    "experiments": "listings:experiments",
    "profiles": "profiles:app",
    "link": "link:app",
    "papers": "papers:app",
    "schema": "schema:schema",
}
"""Maps a command to its module in slambed.commands and the function or app there. Help lists
commands in this order, apps last. These modules import heavy packages only inside functions,
because help and every mistyped name load all of them."""
WITHOUT_COMMAND = ("--version", "--install-completion", "--show-completion")


@app.callback(invoke_without_command=True)
def common(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    """A reproducible testbed for edge-offloaded visual SLAM."""
    if version:
        typer.echo(f"slambed {__version__}")
    elif context.invoked_subcommand is None:
        typer.echo(context.get_help())


@cache
def _add(name: str) -> None:
    """Adds a command once, because tests call several commands in one process."""
    module, _, attribute = COMMANDS[name].partition(":")
    found = getattr(import_module(f"slambed.commands.{module}"), attribute)
    if isinstance(found, typer.Typer):
        app.add_typer(found, name=name)
    else:
        app.command(name)(found)


def every_command() -> TyperGroup:
    """Returns the group with every command loaded, in the order of COMMANDS."""
    for name in COMMANDS:
        _add(name)
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    # Commands that were loaded earlier in this process come first.
    group.commands = {name: group.commands[name] for name in COMMANDS}
    return group


def _add_commands(asked: str) -> None:
    """Loads the module of the given command, or all modules for help and for an unknown command."""
    line = completion.asked(os.environ)
    if line is not None:
        asked = renewed(line.words[:1])[0][0] if line.words else ""
        if completion.add_stand_ins(app, line, COMMANDS):
            return
    if asked in WITHOUT_COMMAND:
        return
    for name in [asked] if asked in COMMANDS else COMMANDS:
        _add(name)


def main() -> None:
    """Runs the command; every failure becomes one line and a documented exit code."""
    open_closed()
    accept_any_text()
    if signal.getsignal(signal.SIGHUP) == signal.SIG_DFL:
        # A lost connection ends a command as Ctrl-C does; under nohup it does not.
        signal.signal(signal.SIGHUP, interrupt_once)
    settle_font_caches()
    forget_backend()
    sys.exit(run_command(sys.argv[1:]))


def run_command(arguments: list[str]) -> int:
    try:
        arguments, note = renewed(arguments)
        if note:
            typer.echo(note, err=True)
        _add_commands(arguments[0] if arguments else "")
        result = app(args=arguments, prog_name="slambed", standalone_mode=False)
        return result if isinstance(result, int) else ExitCode.OK
    except (Exception, KeyboardInterrupt) as error:
        if replace_gone():
            if isinstance(error, BrokenPipeError):
                return ExitCode.OK  # the reader of the pipe (`| head`) closed it
            if isinstance(error, OSError) and error.errno == errno.EIO:
                return INTERRUPTED  # the terminal closed during output
        line, code = line_and_code(error)
        typer.echo(f"error: {' '.join(line.split())}", err=True)
        return code
    finally:
        if arguments and not set(arguments) <= {"--version", "--help"}:
            give_written_to_caller()
