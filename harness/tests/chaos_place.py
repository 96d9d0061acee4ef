# SPDX-License-Identifier: Apache-2.0
"""Setup of chaos campaigns: a generated sequence, an experiment, a warm cache, and the files of
an undisturbed virtual campaign."""

import os
import subprocess
import sys
from pathlib import Path

from chaos_campaign import COMMAND, Campaign, Outcome, Torment
from chaos_daemon import Daemon
from chaos_user import User, python_of_everybody
from virtual_parts import fingerprints, make_sequence, write_experiment

from slambed.campaign.folder import ResultFolder
from slambed.engines.docker_image import image_tag

SECONDS = 2
RUNS = {"virtual": 12, "dask": 6, "live": 2, "docker": 2}
ENGINES = {"live": "local", "docker": "docker"}
LIVE = """\
id: walk
title: A short walk with an edge
systems:
  - {{system: edgeslam, variant: static, label: offloaded, params: {{sync_period_s: 0.5}}}}
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
link: {{backend: relay, profiles: [{{name: some, rtt_ms: 20}}]}}
devices: {{mobile: host, edge: host}}
runs: {{default: {runs}}}
tolerances: {{rtt_error_ms_median: 1000}}
"""


class Place:
    """Common to all campaigns of one kind."""

    def __init__(self, folder: Path, kind: str, runs: int = 0) -> None:
        self.folder = folder
        os.environ["SLAMBED_CACHE"] = str(folder / "cache")
        os.environ["SLAMBED_DATA_BESIDE"] = "no"
        sequence = make_sequence(folder / "sequence", SECONDS)
        self.daemon: Daemon | None = None
        self.user: User | None = None
        more = (LIVE,) if kind in ENGINES else ()
        self.experiment = write_experiment(folder, sequence, runs or RUNS[kind], *more)
        self.own_disk = os.geteuid() == 0
        self.reference: dict[str, str] | None = None
        if kind not in ENGINES:
            self.reference = self._undisturbed()
        if kind == "docker":
            self._containers()

    def _containers(self) -> None:
        """Creates a daemon with the node image, and a user who may use it without root."""
        self.user = User(python_of_everybody(self.folder / "python"))
        self.folder.chmod(0o755)
        cache = self.folder / "cache-user"
        cache.mkdir()
        self.user.own(cache)
        self.daemon = Daemon(self.folder / "docker", self.user.gid)
        self.daemon.copy(image_tag())

    def close(self) -> None:
        """Removes everything that campaigns had in common."""
        if self.daemon is not None:
            self.daemon.close()

    def _undisturbed(self) -> dict[str, str]:
        calm = self.folder / "calm"
        command = [sys.executable, "-c", COMMAND, "run", "--no-figures"]
        command += [str(self.experiment), "--results", str(calm)]
        subprocess.run(command, check=True, capture_output=True)
        return fingerprints(ResultFolder(calm / self.experiment.stem))

    def play(self, torment: Torment) -> Outcome:
        """Executes one campaign."""
        options = ["--jobs", str(torment.jobs)]
        if torment.kind in ENGINES:
            options = ["--engine", ENGINES[torment.kind], "--wait", "--retries", "5"]
        user = self.user if torment.unprivileged else None
        campaign = Campaign(
            self.folder,
            self.experiment,
            torment,
            self.own_disk,
            self.reference,
            options,
            self.daemon,
            user,
        )
        return campaign.play()
