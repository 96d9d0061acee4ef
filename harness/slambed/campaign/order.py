# SPDX-License-Identifier: Apache-2.0
"""The order of runs: cells are interleaved, so that drift of the host affects all of them."""

import random

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
