# SPDX-License-Identifier: Apache-2.0
"""How a live node ended: by itself, at its memory limit, or from outside."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from slambed.engines.base import Node, last_line
from slambed.errors import KilledError, SlambedError
from slambed.process.endings import ended_from_outside, ending
from slambed.records.node_report import NodeReport
from slambed.spec.system import Role


def node_report(node: Node, run_dir: Path) -> NodeReport:
    """Returns the node's own report; empty if it could not write one."""
    return NodeReport.read(run_dir / node.role / "node.json") or NodeReport()


def from_outside(node: Node, code: int, run_dir: Path) -> str | None:
    """Returns how a node was ended from outside; None if it ended by itself. To be used only for
    ends that the harness did not request.

    A node that receives SIGTERM (as from a stopping daemon) writes all files and exits with 0; its
    report says that it was stopped.
    """
    if ended_from_outside(code) and not node.out_of_memory():
        return f"was killed from outside ({ending(code)})"
    if code == 0 and node_report(node, run_dir).stopped:
        return "was asked to stop from outside"
    return None


def how_it_died(node: Node, code: int, run_dir: Path) -> str:
    """Returns one line for the outcome."""
    if (outside := from_outside(node, code, run_dir)) is not None:
        return f"{node.role} node: {outside}"
    how = "killed at its memory limit" if node.out_of_memory() else ending(code)
    return f"{node.role} node: {how}; last line: {last_line(run_dir / node.role / 'log.txt')}"


@contextmanager
def at_start_barrier(nodes: Mapping[Role, Node]) -> Iterator[None]:
    """Treats errors as temporary if a node has ended: before the start barrier opens no code of
    the system runs, so the node was killed from outside."""
    try:
        yield
    except (SlambedError, OSError) as error:
        for role, node in nodes.items():
            if (code := node.exit_code()) is not None:
                line = f"the {role} node was killed at its start barrier ({ending(code)}): {error}"
                raise KilledError(line) from error
        raise
