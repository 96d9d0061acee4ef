# SPDX-License-Identifier: Apache-2.0
"""`slambed masks`: networks, and what they find in sequences."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.table import Table

from slambed.data.catalog import prepare
from slambed.data.prepared import PreparedSequence
from slambed.outputs import picture
from slambed.segment import TRUTH
from slambed.segment.mask_cache import MaskCache
from slambed.segment.masks import mask_cache
from slambed.segment.network import load_network, network_names
from slambed.segment.scores import Scores
from slambed.segment.sheet import write_mask_sheet
from slambed.terminal import console

NETWORK, QUALITY, N_M = "slambed_people", 90, 0.8

app = typer.Typer(help="Networks, and what they find in sequences.", no_args_is_help=True)
Id = Annotated[str, typer.Argument(help="id or alias of a dataset, or a prepared folder")]
NetworkName = Annotated[str, typer.Option("--network", help="name in networks/, or 'truth'")]
Quality = Annotated[int, typer.Option(min=1, max=100, help="of the JPEGs")]
NMax = Annotated[float, typer.Option("--n-m", min=0, max=1, help="overlap at which two are one")]


@app.command("list")
def list_networks() -> None:
    """All networks."""
    table = Table("id", "licence", "size", "title", box=None)
    for name in network_names():
        network = load_network(name)
        table.add_row(name, network.licence, f"{network.size_bytes / 1e6:.2f} MB", network.title)
    console().print(table)


@app.command("prepare")
def prepare_masks(
    dataset: Id,
    network: NetworkName = NETWORK,
    quality: Quality = QUALITY,
    n_m: NMax = N_M,
) -> None:
    """Segment every picture of a sequence once."""
    _, masks, path = _masks(dataset, network, quality, n_m)
    typer.echo(f"{path}: {len(masks)} pictures, made for '{masks.key}'")


@app.command()
def show(
    dataset: Id,
    network: NetworkName = NETWORK,
    quality: Quality = QUALITY,
    n_m: NMax = N_M,
    frames: Annotated[int, typer.Option(min=1, max=200, help="pictures on the sheet")] = 16,
    output: Annotated[Path | None, typer.Option(help="PNG to write")] = None,
) -> None:
    """Write a contact sheet of masks."""
    sequence, masks, _ = _masks(dataset, network, quality, n_m)
    file = output or picture(f"{sequence.info.id}_{network}.png")
    write_mask_sheet(sequence, masks, file, frames)
    typer.echo(str(file))


@app.command()
def score(
    dataset: Id,
    network: NetworkName = NETWORK,
    quality: Quality = QUALITY,
    n_m: NMax = N_M,
) -> None:
    """Compare masks with the truth of a generated sequence; without one, tell the marked share."""
    sequence, masks, _ = _masks(dataset, network, quality, n_m)
    if not sequence.info.source.get("labels_sha256"):
        shares = [float(masks.frame(i).moving().mean()) for i in range(len(masks))]
        told = {"marked_share_mean": float(np.mean(shares)), "marked_share_max": max(shares)}
        typer.echo(json.dumps(told))
        return
    truth = MaskCache.open(mask_cache(sequence, TRUTH, quality, n_m))
    scores = Scores()
    for i in range(len(masks)):
        scores.add(masks.frame(i), truth.frame(i))
    typer.echo(json.dumps(scores.as_dict()))


def _masks(
    dataset: str, network: str, quality: int, n_m: float
) -> tuple[PreparedSequence, MaskCache, Path]:
    sequence = prepare(dataset)
    path = mask_cache(sequence, network, quality, n_m)
    return sequence, MaskCache.open(path), path
