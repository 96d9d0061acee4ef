# SPDX-License-Identifier: Apache-2.0
"""Shared parts of the models of papers/*/paper.yaml."""

from typing import Literal

from pydantic import BaseModel, ConfigDict

STRICT = ConfigDict(extra="forbid", frozen=True)
Number = float | int
Match = dict[str, str | list[str]]
"""Maps a column of summary.csv (or params.<name>) to a pattern or several; `*` matches anything."""

Provenance = Literal[
    "fitted", "same_data", "stand_in", "parameter", "duplicate", "erratum", "measured"
]
"""Origin of our number, which determines the value of an agreement; only `measured` is evidence.

fitted: our devices were fitted to the published number (`fits` of catalog/devices/fits/*.yaml).
same_data: ours follows from what the paper printed (sizes, traces); nothing was measured.
stand_in: measured, but on another sequence than the paper's.
parameter: a setting or a property of the data, compared with our configuration.
duplicate: the same number is printed elsewhere and counted there.
erratum: the paper contradicts itself here.
measured: our runs, on the paper's sequence, with nothing fitted to this number.
"""


class Strict(BaseModel):
    """A model that rejects unknown keys."""

    model_config = STRICT
