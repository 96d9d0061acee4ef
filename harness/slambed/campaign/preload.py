# SPDX-License-Identifier: Apache-2.0
"""Modules and caches that the fork server of virtual runs loads before it forks the first run.

Otherwise every worker process would load them itself. The server lives as long as the harness, so
cached values stay correct.
"""

import gc
import importlib
import pickle
import sys
from contextlib import suppress
from types import TracebackType

from slambed.campaign.manifest import git_state, versions
from slambed.errors import SlambedError
from slambed.metrics.catalog import metrics_of
from slambed.spec.host_speed import cpu_model
from slambed.spec.library import Library

MODULES = (
    *("slambed.campaign.processes", "slambed.campaign.raw_folder"),
    *("pyarrow.dataset", "pyarrow.pandas_compat", "scipy.spatial.transform"),
    # The process of every run imports the user's main program.
    "slambed.commands.main",
)
"""What executes a run, and what that would import lazily."""


def prepare() -> None:
    """Fills the per-process caches. An invalid system.yaml is reported later by its user."""
    for name in MODULES:
        importlib.import_module(name)
    git_state()
    versions()
    cpu_model()
    for system in Library().systems():
        with suppress(SlambedError):
            metrics_of(system)
    # Excludes existing objects from garbage collection in the runs.
    gc.collect()
    gc.freeze()


def half_a_request(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """Silences the error when a killed harness leaves an incomplete request: nobody waits for
    it."""
    if not issubclass(kind, EOFError | ConnectionError | pickle.UnpicklingError):
        sys.__excepthook__(kind, error, trace)


sys.excepthook = half_a_request
prepare()
