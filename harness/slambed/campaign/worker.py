# SPDX-License-Identifier: Apache-2.0
"""The process behind `workers.Worker`: reads tasks from standard input until it ends.

A task is what `answer` takes, as one line of JSON.
"""

import json
import os
import signal
import sys
import threading
from pathlib import Path
from typing import Any

from slambed.campaign.makers import VirtualMaker
from slambed.errors import ExitCode, SlambedError
from slambed.spec.matrix import RunSpec


def main() -> None:
    """One task a line, one answer a line."""
    # Whatever else writes to standard output must not be taken for an answer.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    # The run in hand ends its program on the way out.
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(0))
    for line in sys.stdin:
        print(json.dumps(answer(json.loads(line))), file=answers, flush=True)


def answer(task: dict[str, Any]) -> dict[str, Any]:
    """Makes one run; an error becomes its line and exit code."""
    try:
        spec = RunSpec.model_validate(task["spec"])
        features = Path(task["features"]) if task["features"] else None
        played = {spec.dataset: (Path(task["sequence"]), float(task["played_s"]))}
        maker = VirtualMaker(played, Path(task["program"]), features, task["command"])
        return {"summary": maker.make(spec, Path(task["raw"]), threading.Event())}
    except SlambedError as error:
        return refusal(str(error), error.code)
    except Exception as error:  # Told where a person sees it: by the campaign.
        line = f"a bug of slambed: {type(error).__name__}: {error}"
        return refusal(line, ExitCode.INTERNAL)


def refusal(error: str, code: ExitCode) -> dict[str, Any]:
    """The answer when there is no run."""
    return {"error": error, "code": int(code)}


if __name__ == "__main__":
    main()
