# SPDX-License-Identifier: Apache-2.0
"""Segmentation of the runs of a plan: virtual runs need masks, computed once per sequence and
then reused; live runs use the network itself."""

from collections.abc import Callable, Iterable
from functools import partial

from slambed.campaign.datasets import Sequence
from slambed.data.prepared import PreparedSequence
from slambed.errors import SlambedError
from slambed.segment import TRUTH
from slambed.segment.network import load_network, network_file
from slambed.spec import inputs
from slambed.spec.masks import Masks, MasksAsked

Notify = Callable[[str], None]
PROGRESS_EVERY = 500
"""Pictures between two progress lines: about 15 s on one core."""


def make_masks(
    asked: Iterable[MasksAsked], sequences: dict[str, Sequence], notify: Notify
) -> dict[tuple[str, MasksAsked], Masks]:
    """Returns (name, settings) -> masks for every sequence by its name in the experiment.

    Raises SlambedError for an unknown network, one without a file or with a wrong checksum, and for
    the ground truth of a sequence that has none.
    """
    return {
        (name, want): _masks(want, sequence, notify)
        for want in asked
        for name, sequence in sequences.items()
    }


def _masks(want: MasksAsked, sequence: Sequence, notify: Notify) -> Masks:
    from slambed.segment.masks import is_made, mask_cache, mask_key  # loads OpenCV

    prepared = PreparedSequence.open(sequence.path)
    parts = (prepared, want.network, want.quality, want.n_m)
    title = f"masks of {sequence.id} by {want.network}"
    if not is_made(mask_key(*parts)):
        notify(f"{title}: {len(prepared)} pictures")
    path = mask_cache(*parts, partial(_progress, notify, title), notify)
    return Masks(
        network=want.network,
        n_m=want.n_m,
        path=str(path),
        key=mask_key(*parts),
        sha256=inputs.sha256_of(path),
    )


def networks_of(
    asked: Iterable[MasksAsked], sequences: Iterable[str]
) -> dict[tuple[str, MasksAsked], Masks]:
    """Returns the same for live runs, which segment pictures online and use no mask cache.

    Raises SlambedError for ground truth, which only virtual runs can use, and like make_masks.
    """
    made: dict[tuple[str, MasksAsked], Masks] = {}
    names = list(sequences)
    for want in asked:
        if want.network == TRUTH:
            raise SlambedError(
                "masks are the generator's truth, which nothing can see in a picture; live runs "
                "need a network, or use --engine virtual"
            )
        network = load_network(want.network)
        network_file(network)
        for name in names:
            made[name, want] = Masks(network=want.network, n_m=want.n_m, sha256=network.sha256)
    return made


def _progress(notify: Notify, title: str, done: int, pictures: int) -> None:
    if done % PROGRESS_EVERY == 0 and done < pictures:
        notify(f"{title}: {done} of {pictures}")
