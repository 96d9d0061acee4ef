# SPDX-License-Identifier: Apache-2.0
"""The link of a run in a helper container: for a harness that is not root.

Run as `python -m slambed.campaign.link_helper`. It reads lines of JSON: what to open, then
`{"start": t0_ns}`, `{"alive": true}` and `{"stop": true}`, and answers each with a line. It ends,
and the link with it, at the end of its input.
"""

import json
import sys
from pathlib import Path
from typing import Any

from slambed.campaign.links import RunLink, open_for_run
from slambed.engines.cpu_group import leave_cpu_group
from slambed.errors import ExitCode, SlambedError
from slambed.line_process import error_answer
from slambed.spec.matrix import RunSpec


def main() -> None:
    """One request a line, one answer a line; the first opens the link."""
    leave_cpu_group()
    link: RunLink | None = None
    try:
        for line in sys.stdin:
            request = json.loads(line)
            if "open" in request:
                link = _open(request["open"])
                _tell({"opened": True})
            elif link is not None and "start" in request:
                link.start(int(request["start"]))
                _tell({"started": True})
            elif link is not None and "alive" in request:
                _tell({"alive": link.alive()})
            elif link is not None and "stop" in request:
                _tell({"stopped": link.stop()})
                return
    except SlambedError as error:
        _tell(error_answer(error))
    except Exception as error:  # Told where a person sees it: by the campaign.
        line = f"a bug of slambed: {type(error).__name__}: {error}"
        _tell({"error": line, "code": int(ExitCode.INTERNAL)})
    finally:
        if link is not None:
            link.close()


def _open(asked: dict[str, Any]) -> RunLink:
    return open_for_run(
        RunSpec.model_validate(asked["spec"]),
        Path(asked["mobile"]),
        Path(asked["edge"]),
        Path(asked["log_dir"]),
        float(asked["longest_s"]),
    )


def _tell(answer: dict[str, Any]) -> None:
    print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
