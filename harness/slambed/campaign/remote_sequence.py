# SPDX-License-Identifier: Apache-2.0
"""Data exchanged between a campaign and its remote workers: sequences and packed results."""

import io
import tarfile
from functools import cache
from pathlib import Path

from slambed.campaign.datasets import prepare_sequence
from slambed.errors import SlambedError
from slambed.files.json_file import read_object
from slambed.spec.run_spec import RunSpec


def remote_sequence(spec: RunSpec, there: Path) -> Path:
    """Returns the campaign's path if it holds the same sequence here, or one prepared on this
    machine."""
    if (read_object(there / "sequence.json") or {}).get("checksum") == spec.sequence_checksum:
        return there
    found, checksum = _prepared(spec.dataset)
    if checksum != spec.sequence_checksum:
        raise SlambedError(f"dataset {spec.dataset} is another one here: checksum {checksum[:12]}")
    return found


@cache
def _prepared(dataset: str) -> tuple[Path, str]:
    sequence = prepare_sequence(dataset)
    return sequence.path, sequence.checksum


def pack(folder: Path) -> bytes:
    """Packs the files of a result, without raw logs, whose content is in its tables."""
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w") as archive:
        for path in sorted(folder.rglob("*")):
            if path.is_file() and path.suffix != ".jsonl":
                archive.add(path, path.relative_to(folder).as_posix())
    return packed.getvalue()


def unpack(packed: bytes, folder: Path) -> None:
    """Extracts into an empty folder."""
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        archive.extractall(folder, filter="data")
