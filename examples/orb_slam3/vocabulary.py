# SPDX-License-Identifier: Apache-2.0
"""Writes slambed's vocabulary in DBoW2's text format, which ORB-SLAM2 and ORB-SLAM3 read."""

import sys
import zlib
from pathlib import Path

import numpy as np

MAGIC = b"SLVC"
HEADER_BYTES = 24
# As systems/core/features/vocabulary_io.cpp writes it.
NODE = np.dtype([
    ("descriptor", "u1", 32), ("first_child", "<u4"), ("weight", "<f4"), ("children", "<u2"),
    ("level", "<u2"), ("padding", "<u4"),
])  # fmt: skip


def as_dbow2_text(vocabulary: Path, written: Path) -> Path:
    """Returns a file in DBoW2's text format: the vocabulary itself, or `written`, made of it."""
    with vocabulary.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return vocabulary
    content = vocabulary.read_bytes()
    header, records = content[:HEADER_BYTES], content[HEADER_BYTES:]
    checksum = int.from_bytes(header[20:24], "little")
    if len(header) < HEADER_BYTES or zlib.crc32(records) != checksum:
        sys.exit("error: the vocabulary is damaged: its checksum does not match; copy it again")
    branching, depth = np.frombuffer(content, "<u2", 2, 6)
    nodes = np.frombuffer(content, NODE, offset=HEADER_BYTES)
    parents = np.zeros(len(nodes), int)
    for number, node in enumerate(nodes):
        begin = node["first_child"]
        parents[begin : begin + node["children"]] = number
    # L1 norm, and weights tf-idf: what ORB-SLAM's own file says.
    lines = [f"{branching} {depth} 0 0"]
    for parent, node in zip(parents[1:], nodes[1:], strict=True):
        leaf = int(node["children"] == 0)
        bits = " ".join(map(str, node["descriptor"]))
        lines.append(f"{parent} {leaf} {bits} {node['weight']:.9g}")
    # Without a line end after the last line, which ORB-SLAM would read as a node.
    written.write_text("\n".join(lines))
    return written


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python3 vocabulary.py VOCABULARY.slv ORBVOC.txt")
    as_dbow2_text(Path(sys.argv[1]), Path(sys.argv[2]))
