# SPDX-License-Identifier: Apache-2.0
"""An image of another architecture's programs says so, which decides whether a board gets it."""

import io
import subprocess
import sys
import tarfile
import uuid
from collections.abc import Iterator

import pytest

from slambed.engines.docker_image import connect
from slambed.errors import SlambedError
from slambed.native import repository_root

try:
    CLIENT = connect()
except SlambedError:
    CLIENT = None
pytestmark = pytest.mark.skipif(CLIENT is None, reason="needs Docker")


@pytest.fixture
def image() -> Iterator[str]:
    """An image of one file, which Docker labels with this machine's architecture."""
    archive = io.BytesIO()
    with tarfile.open(fileobj=archive, mode="w") as tar:
        entry = tarfile.TarInfo("program")
        entry.size = 5
        tar.addfile(entry, io.BytesIO(b"bytes"))
    name = f"slambed-test-label:{uuid.uuid4().hex[:8]}"
    subprocess.run(["docker", "import", "-", name], input=archive.getvalue(), check=True)
    yield name
    CLIENT.images.remove(name, force=True)


def test_an_image_is_labeled_with_an_architecture(image: str) -> None:
    before = CLIENT.images.get(image).attrs
    other = "amd64" if before["Architecture"] == "arm64" else "arm64"
    done = subprocess.run(
        [sys.executable, repository_root() / "tools/label_image.py", image, other],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    after = CLIENT.images.get(image).attrs
    assert after["Architecture"] == other and after["RootFS"] == before["RootFS"]
    assert before["Id"] not in [found.id for found in CLIENT.images.list(all=True)]
