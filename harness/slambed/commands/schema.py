# SPDX-License-Identifier: Apache-2.0
"""`slambed schema`."""

from pathlib import Path
from typing import Annotated

import typer

from slambed.errors import SlambedError
from slambed.files.atomic import replacing
from slambed.files.outputs import make_folder
from slambed.suggestion import suggestion


def schema(
    kind: Annotated[str | None, typer.Argument(help="experiment, system, device, ...")] = None,
    folder: Annotated[
        Path | None, typer.Option(help="Write all of them there, as KIND.json.")
    ] = None,
) -> None:
    """Print the JSON schema of a kind of YAML file, for editors; without a kind, list the kinds."""
    from slambed.schema.kinds import KINDS, schema_text

    if kind is not None and folder is not None:
        raise SlambedError("give a kind to print, or --folder to write all")
    if folder is not None:
        make_folder(folder, "--folder")
        for name in KINDS:
            with replacing(folder / f"{name}.json") as out:
                out.write_text(schema_text(name))
        typer.echo(f"{len(KINDS)} schemas in {folder}")
    elif kind is None:
        for name, item in KINDS.items():
            typer.echo(f"{name}: {item.title} ({', '.join(item.places)})")
    elif kind not in KINDS:
        raise SlambedError(f"unknown kind '{kind}'; {suggestion(kind, list(KINDS))}")
    else:
        typer.echo(schema_text(kind), nl=False)
