# SPDX-License-Identifier: Apache-2.0
"""`slambed data`: lists, downloads, prepares and exports sequences."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from slambed.commands.shared_options import SheetOption
from slambed.data import places
from slambed.errors import ExitCode
from slambed.files.outputs import SHEETS, figure_file, must_be_writable, writing
from slambed.terminal import JsonOption, console, lists_alone, print_json

if TYPE_CHECKING:
    from slambed.data.catalog import Catalog
    from slambed.data.prepared import PreparedSequence
    from slambed.data.recipe import Dataset

app = typer.Typer(help="Recorded and generated sequences.")
Id = Annotated[
    str, typer.Argument(help="id or alias of a dataset, its YAML file, or a prepared folder")
]


def state(catalog: Catalog, dataset: Dataset) -> str:
    """Returns prepared, found, generated or missing. For a choice of datasets it returns the one in
    use, and the missing one it replaces."""
    from slambed.data.cache import SequenceCache

    if dataset.first_of:
        taken, wanted = catalog.resolve(dataset.id).id, catalog.stands_in_for(dataset.id)
        return f"takes {taken}" + (f", {wanted.id} is missing" if wanted else "")
    if SequenceCache(places.prepared_folder()).find(dataset) is not None:
        return "prepared"
    if not catalog.available(dataset):
        return "missing"
    return "generated" if dataset.synthetic is not None else "found"


def list_datasets(as_json: JsonOption = False) -> None:
    """List all datasets and whether they are on this machine; exits with 2 where a dataset file
    cannot be read."""
    from slambed.data.catalog import Catalog

    catalog = Catalog.load()
    if as_json:
        print_json(_entries(catalog))
        raise typer.Exit(ExitCode.BAD_INPUT if catalog.broken else ExitCode.OK)
    table = Table("id", "sensor", "state", "title", box=None)
    for dataset in catalog.datasets.values():
        names = ", ".join((dataset.id, *dataset.aliases))
        sensor = "" if dataset.first_of else dataset.sensor
        table.add_row(names, sensor, state(catalog, dataset), dataset.title)
    screen = console()
    screen.print(table)
    screen.print("pictures of one: 'slambed data show ID'")
    screen.print(
        f"missing recordings: 'slambed data download ID'; searched: {_joined(catalog.search)}"
    )
    for error in catalog.broken.values():
        typer.echo(f"not listed: {error}", err=True)
    if catalog.broken:
        raise typer.Exit(ExitCode.BAD_INPUT)


def _entries(catalog: Catalog) -> list[dict[str, object]]:
    """Returns each dataset file with its state, for scripts."""
    return [
        *(
            {**d.model_dump(mode="json"), "state": state(catalog, d)}
            for d in catalog.datasets.values()
        ),
        *({"id": name, "error": str(error)} for name, error in catalog.broken.items()),
    ]


@app.command("prepare")
def prepare_dataset(
    dataset: Id,
    cache: Annotated[
        Path | None,
        typer.Option(
            help="Cache folder; default: $SLAMBED_CACHE, else slambed/ in $XDG_CACHE_HOME or "
            "~/.cache."
        ),
    ] = None,
) -> None:
    """Decode or generate a sequence once; playback then only maps it into memory."""
    from slambed.data.catalog import prepare
    from slambed.data.prepared import SEQUENCE_FILE

    if not (Path(dataset) / SEQUENCE_FILE).is_file():
        _offer_download(dataset)
    with _progress_bar() as bar:
        task = bar.add_task(dataset, total=None)
        sequence = prepare(
            dataset,
            cache,
            lambda done, total: bar.update(task, completed=done, total=total),
            lambda line: bar.console.print(line, highlight=False, soft_wrap=True),
        )
    typer.echo(f"{sequence.path}: {describe(sequence)}")


def _offer_download(name: str) -> None:
    """Offers to download the dataset that a stand-in replaces; without a terminal it prints the
    command."""
    from slambed.data.catalog import Catalog
    from slambed.data.download import how_to_get, recipe_text
    from slambed.data.stand_in import played_instead

    catalog = Catalog.load()
    if (wanted := catalog.stands_in_for(name)) is None:
        return
    message = played_instead(catalog.resolve(name).id, wanted.id, name)
    wanted = catalog.original(wanted)
    if not sys.stdin.isatty() or wanted.download is None or wanted.download.unpack == "none":
        line = "; ".join(filter(None, [message, how_to_get(wanted)]))
        typer.echo(f"note: {line}", err=True)
    elif typer.confirm(
        f"{message}. {recipe_text(wanted, places.download_folder())}. Fetch it now?"
    ):
        # The question already said that no checksum is known.
        download(wanted.id, force=True)


@app.command()
def verify(path: Annotated[Path, typer.Argument(help="folder of a prepared sequence")]) -> None:
    """Check every frame of a prepared sequence against its checksums."""
    from slambed.data.prepared import PreparedSequence

    sequence = PreparedSequence.open(path)
    sequence.verify(full=True)
    typer.echo(f"{path}: intact; {describe(sequence)}; checksum {sequence.checksum}")


@app.command()
def show(
    dataset: Id,
    output: SheetOption = None,
    frames: Annotated[int, typer.Option(min=1, max=200, help="pictures on the sheet")] = 12,
) -> None:
    """Write a contact sheet of a sequence."""
    from slambed.data.catalog import prepare
    from slambed.data.contact_sheet import write_contact_sheet

    asked = figure_file(output, SHEETS) if output else None
    sequence = prepare(dataset)
    file = asked or places.picture(f"{sequence.info.id}.png")
    write_contact_sheet(sequence, file, frames)
    typer.echo(f"{file}: {describe(sequence)}")


@app.command()
def difficulty(
    datasets: Annotated[
        list[str], typer.Argument(help="ids or aliases, YAML files, or prepared folders")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="figure: .png, .svg, .pdf; default: in the cache, its path is printed",
        ),
    ] = None,
    table: Annotated[Path | None, typer.Option(help="CSV to write: a row per gap")] = None,
) -> None:
    """Measure how hard sequences are after a gap: features matched 0.1 to 2 s apart, and how many
    matches are right.

    Features are matched by descriptors alone, as ORB-SLAM2 does after missing frames. Ground truth
    and depth tell which matches are right (without depth: the epipolar line).
    """
    from slambed.data.catalog import prepare
    from slambed.data.difficulty import measure
    from slambed.data.difficulty_report import csv_of, draw, lines_of

    file = figure_file(output) if output else places.picture("difficulty.png")
    must_be_writable(file, "--output")
    if table is not None:
        must_be_writable(table, "--table")
    measured = []
    for name in datasets:
        sequence = prepare(name)
        measured.append(measure(sequence))
        for line in lines_of(measured[-1]):
            typer.echo(line)
    if table is not None:
        with writing(table, "--table"):
            table.write_text(csv_of(measured))
    draw(measured, file)
    typer.echo(f"figure: {file}")


@app.command()
def export(
    dataset: Id,
    layout: Annotated[str, typer.Option("--format", help="tum, euroc, kitti or mcap")],
    output: Annotated[Path | None, typer.Option(help="folder to write; default ID-FORMAT")] = None,
) -> None:
    """Export a sequence as a folder of images, or as a ROS 2 bag, for other programs."""
    from slambed.data.catalog import prepare
    from slambed.data.export import export as write_export

    sequence = prepare(dataset)
    folder = output or Path(f"{sequence.info.id}-{layout}")
    with _progress_bar() as bar:
        task = bar.add_task(dataset, total=None)
        write_export(
            sequence,
            layout,
            folder,
            lambda done, total: bar.update(task, completed=done, total=total),
        )
    typer.echo(f"{folder}: {describe(sequence)}")


@app.command()
def where() -> None:
    """Show the folders that are searched, and the cache."""
    for folder in places.dataset_folders():
        state = places.state_of(folder)
        typer.echo(f"{folder}  (dataset files{f', {state}' if state else ''})")
    for folder in places.search_path():
        state = places.state_of(folder)
        typer.echo(f"{folder}  ({state})" if state else f"{folder}")
    typer.echo(f"{places.prepared_folder()}  (prepared sequences)")


@app.command()
def download(
    dataset: Annotated[str, typer.Argument(help="id or alias of a dataset, or its YAML file")],
    force: Annotated[
        bool,
        typer.Option(help="fetch although the checksum is not known; not what is here already"),
    ] = False,
    dry_run: Annotated[bool, typer.Option(help="only print the recipe")] = False,
) -> None:
    """Fetch a dataset whose checksum is known, or print where it comes from."""
    from slambed.data.catalog import Catalog
    from slambed.data.download import download as fetch
    from slambed.data.download import recipe_text

    catalog = Catalog.load()
    chosen = catalog.original(catalog.get(dataset))
    folder = places.download_folder()
    if dry_run:
        typer.echo(recipe_text(chosen, folder))
        return
    if (found := catalog.locate(chosen)) is not None:
        typer.echo(f"{chosen.id}: is here already, {found}; move it away to fetch it again")
        return
    with _progress_bar() as bar:
        task = bar.add_task(chosen.id, total=None)
        digest = fetch(
            chosen, folder, force, lambda done, total: bar.update(task, completed=done, total=total)
        )
    typer.echo(f"{chosen.id}: in {folder}, sha256 {digest}")


@app.command("import-camera")
def import_camera(
    file: Annotated[
        Path,
        typer.Argument(help="Kalibr camchain, OpenCV or ROS YAML, ORB-SLAM settings, sensor.yaml"),
    ],
    camera: Annotated[int, typer.Option(min=0, help="which camera of the file")] = 0,
    baseline_m: Annotated[
        float | None, typer.Option(min=0, help="to the right camera; of depth, a virtual one")
    ] = None,
) -> None:
    """Convert another tool's calibration to the `camera` of a dataset file and print it."""
    from slambed.data.import_camera import camera_yaml

    text, notes = camera_yaml(file, camera, baseline_m)
    for note in notes:
        typer.echo(f"note: {note}", err=True)
    typer.echo(text)


def describe(sequence: PreparedSequence) -> str:
    """Returns one line about a sequence."""
    info = sequence.info
    truth = "with" if sequence.groundtruth_file else "without"
    return (
        f"{info.frames} frames, {info.width}x{info.height} {info.sensor}, "
        f"{sequence.duration_s:.1f} s, {truth} ground truth"
    )


def _joined(folders: tuple[Path, ...]) -> str:
    return ":".join(str(folder) for folder in folders)


def _progress_bar() -> Progress:
    console = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,  # there it would leave an empty line
    )


lists_alone(app, list_datasets)
