# SPDX-License-Identifier: Apache-2.0
"""Folders named by the user."""

import os
import tempfile
from pathlib import Path

from slambed.errors import SlambedError
from slambed.files.outputs import make_folder

NOBODY = 65534
REFUSED, TAKEN = 42, 43


def test_a_folder_that_is_there_and_not_ours_is_refused_at_once() -> None:
    # Not below pytest's private folder, which other users cannot enter.
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o555)
        make = os.fork()
        if make == 0:
            if os.geteuid() == 0:
                os.setresuid(NOBODY, NOBODY, NOBODY)
            try:
                make_folder(folder, "--results")
            except SlambedError as refused:
                message = f"{folder}: Permission denied; choose another --results"
                os._exit(REFUSED if str(refused) == message else 1)
            os._exit(TAKEN)
        assert os.waitstatus_to_exitcode(os.waitpid(make, 0)[1]) == REFUSED
        folder.chmod(0o755)
        make_folder(folder, "--results")
