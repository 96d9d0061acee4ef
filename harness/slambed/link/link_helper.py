# SPDX-License-Identifier: Apache-2.0
"""The link of a run in a helper container: for a harness that is not root.

Run as `python -m slambed.link.link_helper`. It answers the messages of `helper_messages`, a line
each. It ends, and the link with it, at the end of its input.
"""

import sys
from pathlib import Path

from slambed.errors import ExitCode, SlambedError
from slambed.link.helper_messages import (
    Alive,
    AskAlive,
    LinkStarted,
    LinkStopped,
    Opened,
    OpenLink,
    Request,
    StartLink,
    StopLink,
)
from slambed.link.run_link import RunLink, open_for_run
from slambed.process.line_protocol import Failure, LineReader, adapter, message_in, send
from slambed.sampling.cpu_group import leave_cpu_group


def main() -> None:
    """One request a line, one answer a line; the first opens the link."""
    leave_cpu_group()
    link: RunLink | None = None
    requests = LineReader(sys.stdin.fileno())
    try:
        while (line := requests.next(None)) is not None:
            request = message_in(line, adapter(Request), "harness")
            if isinstance(request, OpenLink):
                link = _open(request)
                send(sys.stdout, Opened())
            elif link is not None and isinstance(request, StartLink):
                link.start(request.t0_ns)
                send(sys.stdout, LinkStarted())
            elif link is not None and isinstance(request, AskAlive):
                send(sys.stdout, Alive(alive=link.alive()))
            elif link is not None and isinstance(request, StopLink):
                send(sys.stdout, LinkStopped(link=link.stop()))
                return
    except EOFError:
        return
    except SlambedError as error:
        send(sys.stdout, Failure.of(error))
    except Exception as error:  # Reported where a person sees it: by the campaign.
        message = f"a bug of slambed: {type(error).__name__}: {error}"
        send(sys.stdout, Failure(error=message, code=int(ExitCode.INTERNAL)))
    finally:
        if link is not None:
            link.close()


def _open(asked: OpenLink) -> RunLink:
    return open_for_run(
        asked.spec, Path(asked.mobile), Path(asked.edge), Path(asked.log_dir), asked.longest_s
    )


if __name__ == "__main__":
    main()
