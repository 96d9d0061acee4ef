# SPDX-License-Identifier: Apache-2.0
"""Draws requested, applied and measured round-trip time of one run, and the one-way times of its
messages."""

import pandas as pd

from slambed.link.impairments import outages_within
from slambed.metrics.messages import messages_of
from slambed.metrics.network import series
from slambed.report.conditions import Condition, typical_run
from slambed.report.load import Results
from slambed.report.style import (
    FAULT_SHADE,
    FigureWriter,
    fault_color,
    figure,
    file_name,
    legend_beneath,
)
from slambed.spec.board import NETWORK
from slambed.spec.device import VIRTUAL

PROBE, ASKED, APPLIED = "#0072B2", "#000000", "#E69F00"
FAR_APART = 8.0
"""Messages that wait for an outage take so much longer than the RTT that a linear axis hides it."""
MESSAGES = {"up": "#009E73", "down": "#CC79A7"}


def draw_rtt(results: Results, condition: Condition, writer: FigureWriter) -> None:
    """Draws the run with the median RTT error among those with a link."""
    runs = condition.runs[condition.runs["link_backend"].notna()]
    key = typical_run(runs, "rtt_error_ms_median")
    link = results.table(key, "link") if key else None
    if key is None or link is None:
        return
    link = link[link["t_s"] >= 0]
    asked, probe = series(link, "asked_rtt_ms"), series(link, "probe_rtt_ms")
    applied = _both_ways(link)
    messages = _one_way(results, key)
    end_s = float(link["t_s"].max())
    outages = outages_within(results.links.get(condition.profile, {}), end_s)
    if probe.empty and not asked["value"].any() and not outages:
        return  # a virtual link that adds nothing
    with figure(height_in=3.2) as (made, axes):
        axis = axes[0]
        if len(probe):
            axis.plot(
                probe["t_s"],
                probe["value"],
                ".",
                color=PROBE,
                markersize=3,
                zorder=3,
                label="measured",
            )
        if len(applied):
            axis.step(
                applied["t_s"],
                applied["value"],
                where="post",
                color=APPLIED,
                linewidth=2.4,
                alpha=0.8,
                label="latency set, both ways",
            )
        for way, shape in (("up", "^"), ("down", "v")):
            own = messages[messages["direction"] == way]
            if len(own):
                axis.plot(
                    own["t_s"],
                    own["value"],
                    shape,
                    color=MESSAGES[way],
                    markersize=2,
                    alpha=0.6,
                    label=f"message {way}, one way",
                )
        if len(asked):
            axis.plot(asked["t_s"], asked["value"], color=ASKED, linestyle="--", label="asked")
        for number, (begin_s, stop_s) in enumerate(outages):
            axis.axvspan(
                begin_s,
                min(stop_s, end_s),
                color=fault_color("cut"),
                alpha=FAULT_SHADE,
                linewidth=0,
                label="outage" if number == 0 else None,
            )
        axis.set_xlabel("time [s]")
        axis.set_ylabel("RTT, or one way of a message [ms]")
        # A quantile is used, so that a single late probe does not flatten the plot.
        rtt_ms, message_ms = (
            max((float(part["value"].quantile(0.998)) for part in parts if len(part)), default=0.0)
            for parts in ((asked, probe), (messages,))
        )
        top = max(1.0, 1.1 * rtt_ms, 1.1 * message_ms)
        if message_ms > FAR_APART * rtt_ms > 0:
            axis.set_yscale("log")
            axis.set_ylim(max(0.1, 0.4 * float(asked["value"].quantile(0.05))), top)
        else:
            axis.set_ylim(0, top)
        axis.set_title(f"Link: {condition.title}")
        legend_beneath(made, axis)
        row = runs[runs["run_key"] == key].iloc[0]
        error = row["rtt_error_ms_median"]
        proof = "."
        if error is not None and error == error:
            proof = f", the one with the median error. Median error {error:.2f} ms."
        writer.save(
            made,
            file_name("rtt", condition.dataset, condition.profile),
            f"Round-trip time: {condition.title}",
            f"{_source(row, probe)}; run {key}, {row['label']}{proof} Messages take what their "
            "size, queues and jitter add to the latency.",
            pd.concat(
                [
                    asked.assign(series="asked_rtt_ms"),
                    applied.assign(series="applied_rtt_ms"),
                    probe.assign(series="probe_rtt_ms"),
                    messages.assign(series="message_" + messages.pop("direction") + "_ms"),
                ],
                ignore_index=True,
            ),
        )


def _one_way(results: Results, key: str) -> pd.DataFrame:
    """Returns the one-way time in ms of each message that arrived, by direction and time of
    sending."""
    log = results.events(key, ("message",))
    messages = messages_of(pd.DataFrame(log.events if log is not None else []))
    arrived = messages.dropna(subset=["sent_s", "received_s"])
    named = arrived.rename(columns={"sent_s": "t_s", "under_way_ms": "value"})
    return named[["t_s", "value", "direction"]]


def _source(row: pd.Series, probe: pd.DataFrame) -> str:
    """Returns the origin of the curves; only a link of real packets can be measured."""
    if row["link_backend"] == VIRTUAL:
        return "Asked by the profile and set in the modeled link, which needs no measurement"
    if row["link_backend"] == NETWORK:
        return "The network to a real board, measured by echoes"
    if probe.empty:
        return "Asked by the profile, set in the link, not measured"
    return "Asked by the profile, set in the link, measured by echoes"


def _both_ways(link: pd.DataFrame) -> pd.DataFrame:
    """Returns up plus down delay at each time at which the up delay was set."""
    up, down = series(link, "applied_up_ms"), series(link, "applied_down_ms")
    if up.empty or down.empty:
        return pd.DataFrame({"t_s": [], "value": []})
    both = pd.merge_asof(up, down, on="t_s", suffixes=("_up", "_down"))
    both["value"] = both["value_up"] + both["value_down"]
    return both[["t_s", "value"]].dropna()
