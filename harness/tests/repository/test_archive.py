# SPDX-License-Identifier: Apache-2.0
"""The files of a commit without its repository, as `git archive` and GitHub's ZIP have them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from checkout import known_files, needs_history
from virtual_parts import make_sequence, needs_programs, write_experiment

from slambed.campaign.folder import ResultFolder
from slambed.errors import ExitCode
from slambed.native import find_program, repository_root

NEEDED = (
    *("CMakeLists.txt", "catalog", "cmake", "docker", "experiments", "harness/slambed"),
    *("netem_profiles", "papers/*.yaml", "pyproject.toml", "systems"),
)
"""What a run reads."""
SLAMBED = [sys.executable, "-c", "from slambed.commands.main import main; main()"]


@needs_history
@needs_programs
def test_an_archive_runs_and_its_manifests_have_no_commit(tmp_path: Path) -> None:
    """The archive lies in a repository of something else, whose commit is none of ours."""
    archive = tmp_path / "theirs" / "archive"
    for name in known_files(repository_root(), *NEEDED):
        (archive / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(repository_root() / name, archive / name)
    git = ["git", "-C", str(archive.parent), "-c", "user.name=a", "-c", "user.email=a@b.c"]
    subprocess.run([*git, "init", "--quiet"], check=True)
    subprocess.run([*git, "commit", "--quiet", "--allow-empty", "-m", "Theirs"], check=True)
    experiment = write_experiment(tmp_path, make_sequence(tmp_path / "walk", 1), 1)
    options = ["--engine", "virtual", "--jobs", "1", "--no-figures", "--results", "results"]
    done = subprocess.run(
        [*SLAMBED, "run", str(experiment), *options],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env=os.environ
        | {"PYTHONPATH": str(archive / "harness")}
        | {"SLAMBED_BIN": str(find_program("slambed-sim").parent)},
    )
    assert done.returncode in (ExitCode.OK, ExitCode.NOT_ALL_GOOD), done.stderr
    folder = ResultFolder(tmp_path / "results" / "walk")
    manifests = [folder.manifest(key) for key in folder.run_keys()]
    assert manifests
    for manifest in manifests:
        assert manifest is not None and (manifest.commit, manifest.dirty) == (None, None)
