# SPDX-License-Identifier: Apache-2.0
"""Holds the link of a run in a helper container, for a harness without root privileges.

Run as `python -m slambed.link.link_helper`. It answers the messages of `helper_messages`, one per
line. When its input ends, it takes the link down and exits.
"""

import sys
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from slambed.link.helper_messages import (
    Alive,
    AskAlive,
    LinkStopped,
    Opened,
    OpenLink,
    Request,
    StopLink,
)
from slambed.link.run_link import RunLink, open_for_run
from slambed.process.line_protocol import (
    LineReader,
    Start,
    Started,
    adapter,
    last_answer,
    message_in,
    send,
)
from slambed.sampling.cpu_group import leave_cpu_group


def main() -> None:
    """Answers requests, one per line; the first one opens the link."""
    leave_cpu_group()
    answer = partial(send, sys.stdout)
    with last_answer(answer), ExitStack() as until_the_end:
        link: RunLink | None = None
        requests = LineReader(sys.stdin.fileno())
        while (line := requests.next(None)) is not None:
            request = message_in(line, adapter(Request), "harness")
            if isinstance(request, OpenLink):
                link = _open(request)
                until_the_end.callback(link.close)
                answer(Opened())
            elif link is not None and isinstance(request, Start):
                link.start(request.t0_ns)
                answer(Started())
            elif link is not None and isinstance(request, AskAlive):
                answer(Alive(alive=link.alive()))
            elif link is not None and isinstance(request, StopLink):
                answer(LinkStopped(link=link.stop()))
                return


def _open(asked: OpenLink) -> RunLink:
    return open_for_run(
        asked.spec, Path(asked.mobile), Path(asked.edge), Path(asked.log_dir), asked.longest_s
    )


if __name__ == "__main__":
    main()
