# SPDX-License-Identifier: Apache-2.0
"""Data exchanged between a campaign and its remote workers: sequences and packed results."""

import io
import tarfile
from functools import cache
from pathlib import Path

from slambed.campaign.datasets import prepare_sequence
from slambed.campaign.raw_folder import must_be_prepared
from slambed.campaign.store import kept_of
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
    must_be_prepared(spec, found)  # may have been deleted since this worker prepared it
    return found


@cache
def _prepared(dataset: str) -> tuple[Path, str]:
    sequence = prepare_sequence(dataset)
    return sequence.path, sequence.checksum


def with_reference(spec: RunSpec, content: bytes | None, scratch: Path) -> RunSpec:
    """Returns the run with a copy, in `scratch`, of the path that it is compared with; the
    campaign's machine has the original."""
    if content is None:
        return spec
    place = scratch / "reference"
    place.write_bytes(content)
    return spec.model_copy(update={"reference": str(place)})


def pack(folder: Path) -> bytes:
    """Packs the files of a result that the store keeps, without raw logs, whose content is in its
    tables. Whatever else a program left there, such as a link to anywhere, stays behind."""
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w") as archive:
        kept = [folder / name for name in kept_of(folder)]
        for whole in (path for path in kept if not path.is_symlink()):
            for path in [whole, *sorted(whole.rglob("*"))]:
                if path.is_file() and not path.is_symlink() and path.suffix != ".jsonl":
                    archive.add(path, path.relative_to(folder).as_posix())
    return packed.getvalue()


def unpack(packed: bytes, folder: Path) -> None:
    """Extracts into an empty folder."""
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        archive.extractall(folder, filter="data")
