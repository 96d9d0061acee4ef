# SPDX-License-Identifier: Apache-2.0
"""The terminal view of `slambed watch`."""

from collections.abc import Sequence
from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.measure import Measurement
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from slambed.campaign.campaign_state import CampaignState
from slambed.campaign.progress import duration
from slambed.campaign.run_in_hand import NodeUse, Playing
from slambed.campaign.watch import Watched
from slambed.spec.device import VIRTUAL

BAR_WIDTH = 40
BARS = "\u2581\u2582\u2583\u2584\u2585\u2586\u2587\u2588"
BARS_ASCII = "_.-=+*#"
"""For terminals that know no other letters."""
STATE_STYLES = {"ok": "green", "lost": "red", "not_initialized": "dim"}
AT_THE_END = "its events come at its end"
"""Shown for virtual runs, because a simulation writes its events when it is done."""


def view(campaigns: list[Watched]) -> RenderableType:
    """Returns all campaigns, one below the other."""
    return Group(*(part for watched in campaigns for part in _campaign(watched)))


def _campaign(watched: Watched) -> list[RenderableType]:
    state = watched.state
    engine = f", engine {watched.engine}" if watched.engine else ""
    # Long titles wrap like text on a narrow terminal.
    parts: list[RenderableType] = [
        Text.assemble((state.experiment, "bold"), f"{engine}: {watched.title}"),
        Text(queue_line(state)),
    ]
    if state.asked:
        bar = Table.grid()  # a bar alone does not end its line
        bar.add_row(ProgressBar(state.asked, state.done + state.failed, width=BAR_WIDTH))
        parts.append(bar)
    parts += [_run(playing, watched.engine) for playing in watched.playing]
    return [*parts, Text("")]


def queue_line(state: CampaignState) -> str:
    """Returns the progress of the queue in one line."""
    parts = [f"{state.done} of {state.asked} runs done"]
    if state.invalid:
        parts.append(f"{state.invalid} of them invalid")
    if state.failed:
        parts.append(f"{state.failed} failed")
    if state.in_hand:
        parts.append(f"{len(state.in_hand)} in hand")
    parts.append(f"{state.waiting} left")
    if state.there_before:
        parts.append(f"{state.there_before} were there before")
    if state.alive:
        left = state.left_s
        parts.append(
            "time left unknown before the first has ended"
            if left is None
            else f"about {duration(left)} left"
        )
    return ", ".join(parts)


def end_line(state: CampaignState) -> str:
    """Returns how a campaign ended, in one line."""
    how = "interrupted" if state.interrupted else "ended" if state.ended else "broken off (killed)"
    return f"{state.experiment}: {how}; {queue_line(state)}"


def _run(playing: Playing, engine: str | None) -> RenderableType:
    grid = Table.grid(padding=(0, 1))
    grid.add_column(no_wrap=True)
    grid.add_column(overflow="fold")
    grid.add_row("run", Text.assemble((playing.name, "bold"), f" ({playing.run_key})"))
    grid.add_row("time", f"{duration(playing.elapsed_s)} so far" + _run_time(playing))
    if playing.frames_played:
        grid.add_row("frames", frames_line(playing))
    elif engine == VIRTUAL:
        grid.add_row("", Text(AT_THE_END, style="dim"))
    if playing.state is not None:
        style = STATE_STYLES.get(playing.state, "")
        own = f", state {playing.node_state}" if playing.node_state else ""
        grid.add_row("tracking", Text.assemble((playing.state.replace("_", " "), style), own))
    _add_curve(grid, playing, "track_ms", "ms")
    if playing.rtt_ms is not None:
        grid.add_row("RTT", f"{playing.rtt_ms:.1f} ms")
    _add_curve(grid, playing, "rtt_ms", "ms")
    for node, use in playing.nodes.items():
        grid.add_row(node, use_line(use, playing.t_s))
        _add_curve(grid, playing, node, "%")
    return grid


def _add_curve(grid: Table, playing: Playing, name: str, unit: str) -> None:
    """Adds the last seconds of a quantity as a line of its own, once there are two."""
    values = playing.recent.get(name, [])
    if len(values) > 1:
        grid.add_row("", Sparkline(values, unit))


@dataclass(frozen=True)
class Sparkline:
    """A curve from 0 to its largest value in one line, and that value. As many of the last values
    as the terminal is wide."""

    values: Sequence[float | None]
    unit: str

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        known = [value for value in self.values if value is not None]
        most = max(known, default=0.0)
        scale = f" 0 to {most:.0f} {self.unit}"
        shown = self.values[-max(1, options.max_width - len(scale)) :]
        yield Text.assemble((spark(shown, most, BARS_ASCII if options.ascii_only else BARS)), scale)

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        return Measurement(1, options.max_width)


def spark(values: Sequence[float | None], most: float, bars: str = BARS) -> str:
    """Returns a bar per value between 0 and `most`; a space where there is none."""
    return "".join(
        " " if value is None else bars[round((len(bars) - 1) * value / most) if most > 0 else 0]
        for value in values
    )


def _run_time(playing: Playing) -> str:
    if playing.t_s is None or playing.t_s < 0:
        return ""
    return f", run time {playing.t_s:.1f} s"


def frames_line(playing: Playing) -> str:
    """Returns the counts of frames played and tracked, and of track losses."""
    of = f" of {playing.frames_offered}" if playing.frames_offered else ""
    losses = f", {playing.track_losses} track losses" if playing.track_losses else ""
    return f"{playing.frames_played}{of} played, {playing.frames_tracked} tracked{losses}"


def use_line(use: NodeUse, now_s: float | None) -> str:
    """Returns CPU and memory of a node, with the age of an old sample."""
    memory = "" if use.memory_mb is None else f", {use.memory_mb:.0f} MiB"
    age_s = 0.0 if now_s is None else now_s - use.t_s
    old = f" ({age_s:.0f} s ago)" if age_s >= 1.0 else ""
    return f"CPU {use.cpu_percent:.0f} % of a core{memory}{old}"
