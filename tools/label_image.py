# SPDX-License-Identifier: Apache-2.0
"""label_image.py IMAGE ARCHITECTURE: writes an architecture, such as arm64, into a Docker image's
configuration.

Docker labels every image that it imports or builds with its own architecture, whatever --platform
says (Docker 20.10; with the classic builder also 28). Programs and layers stay as they are. Needs
nothing but Python and Docker.
"""

import hashlib
import io
import json
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path


def relabel(saved: Path, labeled: Path, architecture: str) -> None:
    """Copies an archive of `docker save` with one image and changes the architecture."""
    with tarfile.open(saved) as old, tarfile.open(labeled, "w") as new:

        def content(name: str) -> bytes:
            file = old.extractfile(name)
            if file is None:
                raise SystemExit(f"error: {saved} has no {name}")
            return file.read()

        def add(name: str, data: bytes) -> None:
            entry = tarfile.TarInfo(name)
            entry.size = len(data)
            new.addfile(entry, io.BytesIO(data))

        (image,) = json.loads(content("manifest.json"))
        config = json.loads(content(image["Config"]))
        config["architecture"] = architecture
        # It would be that of the machine that built the image.
        config.pop("variant", None)
        data = json.dumps(config).encode()
        name = f"{hashlib.sha256(data).hexdigest()}.json"
        add(name, data)
        layers = []
        for number, layer in enumerate(image["Layers"]):
            layers.append(f"{number}/layer.tar")
            entry = tarfile.TarInfo(layers[-1])
            entry.size = old.getmember(layer).size
            new.addfile(entry, old.extractfile(layer))
        manifest = [{"Config": name, "RepoTags": image["RepoTags"], "Layers": layers}]
        add("manifest.json", json.dumps(manifest).encode())


def inspect(image: str, what: str) -> str:
    """Returns one property of an image, such as Id."""
    command = ["docker", "image", "inspect", "--format", f"{{{{.{what}}}}}", image]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def main() -> int:
    if len(sys.argv) != 3:
        print((__doc__ or "").splitlines()[0], file=sys.stderr)
        return 2
    image, architecture = sys.argv[1:]
    before = inspect(image, "Id")
    with tempfile.TemporaryDirectory(dir="/var/tmp") as folder:
        saved, labeled = Path(folder) / "saved.tar", Path(folder) / "labeled.tar"
        subprocess.run(["docker", "save", "-o", str(saved), image], check=True)
        relabel(saved, labeled, architecture)
        subprocess.run(["docker", "load", "--quiet", "-i", str(labeled)], check=True)
    if (shown := inspect(image, "Architecture")) != architecture:
        print(f"error: Docker still labels {image} {shown}", file=sys.stderr)
        return 1
    if inspect(image, "Id") != before:
        subprocess.run(["docker", "image", "rm", before], check=True, stdout=subprocess.DEVNULL)
    return 0


if __name__ == "__main__":
    sys.exit(main())
