#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Scores a network on clips of tools/people_scenes.py with seeds that it was not trained on.

    tools/score_people.py NETWORK FIRST_SEED SCENES [FRAMES]

NETWORK is a name in catalog/networks/ or a YAML file. Prints one JSON object: overlap, recall and
precision of the masks (recall also by size of figure), key point similarity, the marked share of
pictures without people, and the CPU time per picture on this machine.
"""

from __future__ import annotations

import json
import statistics
import sys
import time

from people_scenes import clips, degrade

from slambed.segment.masks import encode_jpeg
from slambed.segment.network import load_network
from slambed.segment.scores import Scores
from slambed.segment.segmenter import Segmenter

QUALITY, N_M = 90, 0.8


def score(name: str, first: int, scenes: int, frames: int) -> None:
    """Scores the network and prints the result."""
    segmenter, scores, taken_ms, pictures = Segmenter(load_network(name)), Scores(), [], 0
    for sequence, labels, draw, _ in clips(first, scenes, frames):
        for i in range(len(sequence)):
            jpeg = encode_jpeg(degrade(sequence.gray(i), draw), QUALITY)
            begin = time.process_time()
            found = segmenter.segment(jpeg, N_M)
            taken_ms.append(1000 * (time.process_time() - begin))
            scores.add(found, labels.frame(i))
            pictures += 1
    reported = {"first_seed": first, "scenes": scenes, "pictures": pictures, **scores.as_dict()}
    print(json.dumps({**reported, "cpu_ms_median": round(statistics.median(taken_ms), 1)}))


if __name__ == "__main__":
    if len(sys.argv) not in (4, 5):
        sys.exit(__doc__)
    score(sys.argv[1], *(int(a) for a in (*sys.argv[2:], "10")[:3]))
