# SPDX-License-Identifier: Apache-2.0
"""`slambed masks`: segmentation networks, and their masks of sequences."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from slambed.commands.shared_options import SheetOption
from slambed.data.places import picture
from slambed.files.outputs import SHEETS, figure_file
from slambed.segment import TRUTH
from slambed.terminal import JsonOption, console, json_entry, lists_alone, print_json

if TYPE_CHECKING:
    from slambed.data.prepared import PreparedSequence
    from slambed.segment.mask_cache import MaskCache

NETWORK, QUALITY, N_M = "slambed_people", 90, 0.8
say = partial(typer.echo, err=True)

app = typer.Typer(help="Networks, and what they find in sequences.")
Id = Annotated[str, typer.Argument(help="id or alias of a dataset, or a prepared folder")]
NetworkName = Annotated[
    str, typer.Option("--network", help="name in catalog/networks/, or 'truth'")
]
Quality = Annotated[
    int, typer.Option(min=1, max=100, help="JPEG quality of the pictures that the network gets")
]
NMax = Annotated[
    float,
    typer.Option(
        "--n-m", min=0, max=1, help="overlap (0 to 1) above which two finds are one person"
    ),
]


def list_networks(as_json: JsonOption = False) -> None:
    """List all networks."""
    from slambed.segment.network import load_network, network_names

    if as_json:
        print_json([json_entry(name, load_network) for name in network_names()])
        return
    table = Table("id", "license", "size", "title", box=None)
    for name in network_names():
        network = load_network(name)
        table.add_row(name, network.license, f"{network.size_bytes / 1e6:.2f} MB", network.title)
    screen = console()
    screen.print(table)
    screen.print("what one finds in a sequence: 'slambed masks show DATASET --network ID'")


@app.command("prepare")
def prepare_masks(
    dataset: Id,
    network: NetworkName = NETWORK,
    quality: Quality = QUALITY,
    n_m: NMax = N_M,
) -> None:
    """Segment every image of a sequence once and cache the masks."""
    _, masks, path = _masks(dataset, network, quality, n_m)
    typer.echo(f"{path}: {len(masks)} pictures, made for '{masks.key}'")


@app.command()
def show(
    dataset: Id,
    network: NetworkName = NETWORK,
    quality: Quality = QUALITY,
    n_m: NMax = N_M,
    frames: Annotated[int, typer.Option(min=1, max=200, help="pictures on the sheet")] = 16,
    output: SheetOption = None,
) -> None:
    """Write a contact sheet of a sequence's masks."""
    from slambed.segment.sheet import write_mask_sheet

    asked = figure_file(output, SHEETS) if output else None
    sequence, masks, _ = _masks(dataset, network, quality, n_m)
    file = asked or picture(f"{sequence.info.id}_{network}.png")
    write_mask_sheet(sequence, masks, file, frames)
    typer.echo(str(file))


@app.command()
def score(
    dataset: Id,
    network: NetworkName = NETWORK,
    quality: Quality = QUALITY,
    n_m: NMax = N_M,
) -> None:
    """Compare masks with the ground truth of a generated sequence; without it, report the masked
    share."""
    import numpy as np

    from slambed.segment.mask_cache import MaskCache
    from slambed.segment.masks import mask_cache
    from slambed.segment.scores import Scores

    sequence, masks, _ = _masks(dataset, network, quality, n_m)
    if not sequence.info.source.get("labels_sha256"):
        shares = [float(masks.frame(i).moving().mean()) for i in range(len(masks))]
        reported = {"marked_share_mean": float(np.mean(shares)), "marked_share_max": max(shares)}
        typer.echo(json.dumps(reported))
        return
    truth = MaskCache.open(mask_cache(sequence, TRUTH, quality, n_m, notify=say))
    scores = Scores()
    for i in range(len(masks)):
        scores.add(masks.frame(i), truth.frame(i))
    typer.echo(json.dumps(scores.as_dict()))


def _masks(
    dataset: str, network: str, quality: int, n_m: float
) -> tuple[PreparedSequence, MaskCache, Path]:
    from slambed.data.catalog import prepare
    from slambed.segment.mask_cache import MaskCache
    from slambed.segment.masks import mask_cache

    sequence = prepare(dataset)
    path = mask_cache(sequence, network, quality, n_m, notify=say)
    return sequence, MaskCache.open(path), path


lists_alone(app, list_networks)
