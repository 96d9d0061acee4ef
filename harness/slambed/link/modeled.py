# SPDX-License-Identifier: Apache-2.0
"""Configuration of a profile for slambed-sim, which uses the same model as the relay."""

from pathlib import Path

import numpy as np

from slambed.link.direction import ModeledLink
from slambed.link.direction_tables import STEP_MS, delay_table_ms, direction_config
from slambed.link.profile import Profile
from slambed.link.record import ASKED_STEP_S, series_frame


def modeled_link(profile: Profile, horizon_s: float) -> ModeledLink:
    """Returns both directions (docs/reference/run-folder.md, "Virtual run")."""
    up_ms, down_ms = delay_table_ms(profile, horizon_s)
    return ModeledLink(
        step_ms=STEP_MS,
        interpolation="linear",
        up=direction_config(profile, profile.up, up_ms, horizon_s),
        down=direction_config(profile, profile.down, down_ms, horizon_s),
    )


def write_link_log(profile: Profile, played_s: float, folder: Path) -> None:
    """Writes link.parquet of a virtual run: the profile is applied exactly, and nothing is
    probed."""
    folder.mkdir()
    t = np.arange(0.0, played_s + ASKED_STEP_S, ASKED_STEP_S)
    up, down = profile.up_ms(t), profile.down_ms(t)
    frame = series_frame(
        {
            "asked_rtt_ms": (t, up + down),
            "applied_up_ms": (t, up),
            "applied_down_ms": (t, down),
        }
    )
    frame.to_parquet(folder / "link.parquet")
