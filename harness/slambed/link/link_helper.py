# SPDX-License-Identifier: Apache-2.0
"""Holds the link of a run in a helper container, for a harness without root privileges.

Run as `python -m slambed.link.link_helper`. It answers the messages of `helper_messages`, one per
line. When its input ends, it takes the link down and exits.
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
    """Answers requests, one per line; the first one opens the link."""
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
    except Exception as error:  # Sent to the campaign, which reports it to the user.
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
