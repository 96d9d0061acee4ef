# SPDX-License-Identifier: Apache-2.0
"""The order of runs: cells are interleaved, so that drift of the host affects all of them. Parts of
a campaign for several machines."""

import random
import re

from slambed.errors import SlambedError
from slambed.spec.run_spec import RunSpec


def interleaved(specs: list[RunSpec], seed: int) -> list[RunSpec]:
    """Returns all cells once in a seeded order, then all cells again in another order, and so
    on."""
    ordered: list[RunSpec] = []
    for repetition in sorted({spec.repetition for spec in specs}):
        block = [spec for spec in specs if spec.repetition == repetition]
        # One generator per block: more repetitions later do not change the order of the earlier
        # ones.
        random.Random(f"{seed}/{repetition}").shuffle(block)
        ordered += block
    return ordered


def in_part(run_key: str, part: tuple[int, int] | None) -> bool:
    """Returns whether a run belongs to part (i, n) of a campaign, by its key: on every machine the
    same, whatever was played before."""
    return part is None or int(run_key, 16) % part[1] == part[0] - 1


def part_of(text: str) -> tuple[int, int]:
    """Returns (2, 3) for `2/3`. Raises SlambedError for anything else."""
    found = re.fullmatch(r"(\d+)/(\d+)", text)
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise SlambedError(f"--part {text} is no part; write 1/3, 2/3 or 3/3 on three machines")
    return int(found[1]), int(found[2])
