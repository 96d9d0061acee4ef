# SPDX-License-Identifier: Apache-2.0
"""A small paper, experiment and inference plan, shared by the inference tests."""

from pathlib import Path
from typing import Any

import yaml

PAPER: dict[str, Any] = {
    "id": "small",
    "kind": "paper",
    "paper": {"title": "A small paper", "authors": ["A"], "venue": "V", "year": 2020},
    "systems": {
        "alone": {"label": "alone", "match": {"system": "orbslam2"}},
        "helped": {"label": "with an edge", "match": {"system": "edgeslam"}},
    },
    "datasets": {"room": {"label": "the room", "match": ["walk"]}},
    "conditions": {"link": {"wifi": {"profile": "lossy_wifi"}}, "runs": "ignore"},
    "metrics": {
        "losses": {"key": "lost", "statistic": "share", "scale": 100, "better": "lower"},
        "time": {"key": "track_ms_mean", "statistic": "mean", "scale": 1, "better": "lower"},
    },
    "tables": [
        {
            "id": "small.T1", "label": "Table 1", "where": "Sec. 1", "lines": [1, 2],
            "caption": "Losses", "conditions": {"dataset": "room", "link": "wifi", "runs": 100},
            "columns": {"alone": {"label": "Alone", "dims": {"system": "alone"}},
                        "helped": {"label": "Helped", "dims": {"system": "helped"}}},
            "rows": {
                "losses": {"label": "losses", "metric": "losses", "unit": "%", "dims": {},
                           "values": {"alone": 97, "helped": 92}},
                "time": {"label": "time", "metric": "time", "unit": "ms", "dims": {},
                         "values": {"alone": [25, 2], "helped": [25, 2]}},
            },
        }
    ],
}  # fmt: skip

EXPERIMENT = """\
id: walk
title: A short walk, alone and with an edge
reproduces: [small.T1]
systems:
  - {{system: orbslam2, label: alone}}
  - {{system: edgeslam, variant: static, label: offloaded, params: {{sync_period_s: 0.5}}}}
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
link: {{profiles: [lossy_wifi, none]}}
devices:
  mobile: {{device: host, name: slow, cores: 1, speed: 0.04}}
  edge: host
engine: virtual
runs: {{default: 2}}
"""


def plan_content(sequence: str, dark: str, **more: Any) -> dict[str, Any]:
    """A plan with two unknowns: whether it was dark, and the spread of the tracking time."""
    return {
        "id": "dark",
        "title": "Was it dark?",
        "paper": "paper.yaml",
        "experiments": ["walk.yaml"],
        "open": {
            "pictures": {
                "says": "what was seen",
                "set": f"datasets.{sequence}",
                "values": [sequence, dark],
                "printed": sequence,
            },
            "spread": {
                "says": "how the time of tracking varies",
                "set": "devices.mobile.jitter.track",
                "range": [0.1, 0.9],
                "printed": 0.1,
            },
        },
        "fit": ["small.T1.losses.helped"],
        "held_out": ["small.T1.losses.alone", "small.T1.time.alone"],
        "seed": 5,
        "full": {
            "points": 3,
            "first_runs": 5,
            "final_runs": 6,
            "predict_runs": 5,
            "budget_runs": 200,
        },
        "quick": {
            "points": 2,
            "first_runs": 5,
            "final_runs": 5,
            "predict_runs": 5,
            "budget_runs": 100,
        },
        "success": [
            {"says": "fitted inside", "kind": "fitted_inside", "at_least": 1.0},
            {"says": "predicted inside", "kind": "held_out_inside", "at_least": 1.0},
            {"says": "near", "kind": "mean_error", "at_most": 15},
        ],
    } | more


def write_files(folder: Path, content: dict[str, Any], sequence: str) -> Path:
    """Writes paper, experiment and plan to one folder; returns the plan's path."""
    (folder / "paper.yaml").write_text(yaml.safe_dump(PAPER, sort_keys=False))
    (folder / "walk.yaml").write_text(EXPERIMENT.format(sequence=sequence))
    path = folder / f"{content['id']}.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return path
