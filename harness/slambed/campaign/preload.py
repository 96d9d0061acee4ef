# SPDX-License-Identifier: Apache-2.0
"""What the fork server of virtual runs has ready before the first of them is forked.

Every run has a process of its own: what is read, parsed and imported here, once, would else be
done by each of them. It lives as long as the harness, for which all of it holds as well.
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
    # The program that the user called is imported by the process of every run.
    "slambed.commands.main",
)
"""What executes a run, and what it would import late."""


def prepare() -> None:
    """Fills what is cached per process. A system whose file is wrong is reported by who asks for
    it."""
    for name in MODULES:
        importlib.import_module(name)
    git_state()
    versions()
    cpu_model()
    for system in Library().systems():
        with suppress(SlambedError):
            metrics_of(system)
    # What is here now stays: the collector of a run need not look at it again and again.
    gc.collect()
    gc.freeze()


def half_a_request(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """What a harness leaves that is killed while it asks for a process. Nobody waits for it."""
    if not issubclass(kind, EOFError | ConnectionError | pickle.UnpicklingError):
        sys.__excepthook__(kind, error, trace)


sys.excepthook = half_a_request
prepare()
