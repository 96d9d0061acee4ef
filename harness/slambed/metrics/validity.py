# SPDX-License-Identifier: Apache-2.0
"""Decides whether a run took place under the configured circumstances. The performance of the
system is irrelevant: a crash under the right circumstances is a result, a good run under wrong ones
is none.
"""

from slambed.link.proof import NOT_MEASURED
from slambed.metrics.summary import Summary
from slambed.records.kept_spec import KeptSpec
from slambed.records.manifest import Manifest
from slambed.spec.board import NETWORK

NOTABLE_STEAL_PERCENT = 1.0
"""Percent of the host's CPU time; below this, other causes of a stall are more likely."""
RELAYS_RTT_ERROR_MS_P99 = 20.0
"""100 times the relay's error while two compilers run. Netem does not report queueing delays, so
its tail may be caused by the profile."""


def invalid_reasons_of(spec: KeptSpec, manifest: Manifest, summary: Summary) -> list[str]:
    """Returns why host, link or limits differed from the configuration, one line each; empty for
    a valid run."""
    reasons = list(manifest.invalid_reasons or [])
    tolerances = spec.tolerances
    stall, bearable = summary.number("host_stall_ms_max"), tolerances.host_stall_ms_max
    by_steal = _steal(summary)
    if stall is not None and bearable is not None and stall > bearable:
        reasons.append(
            f"the host stalled the mobile node for {stall:.0f} ms, above {bearable:g} ms{by_steal}"
        )
    waited, longest = summary.number("cpu_wait_share"), tolerances.cpu_wait_share_max
    if waited is not None and longest is not None and waited > longest:
        reasons.append(
            f"the mobile node waited for a processor for {waited:.0%} of the time in which it "
            f"wanted one, above {longest:.0%}{by_steal}"
        )
    if spec.link is None or spec.is_virtual:
        return reasons
    if spec.link.backend == NETWORK:
        if summary.completed and summary.number("rtt_measured_ms_mean") is None:
            reasons.append("the RTT of the network to the board was not measured")
        return reasons
    tail_ms = tolerances.rtt_error_ms_p99
    if tail_ms is None and spec.link.backend == "relay":
        tail_ms = RELAYS_RTT_ERROR_MS_P99
    errors = []
    for key, name, allowed in (
        ("rtt_error_ms_median", "median", tolerances.rtt_error_ms_median),
        ("rtt_error_ms_p99", "p99", tail_ms),
    ):
        if allowed is None:
            continue
        error = summary.number(key)
        if error is None:
            # A system that died at once left no time for a measurement; its death is the result.
            if summary.completed:
                errors.append("the RTT of the link was not measured")
                break
        elif error > allowed:
            errors.append(f"RTT error {name} {error:.2f} ms is above {allowed:g} ms{by_steal}")
    # The link judged the same error when it was taken down. With its numbers the verdict is made
    # here, by the tolerances that hold now.
    has_proof = manifest.link is not None and manifest.link.proof is not None
    if errors or has_proof:
        reasons = [x for x in reasons if not _is_links_verdict(x)]
    return reasons + errors


def _is_links_verdict(reason: str) -> bool:
    """Returns whether the link said this of the RTT error (`slambed.link.proof`)."""
    return reason.startswith("link: ") and ("RTT error" in reason or NOT_MEASURED in reason)


def _steal(summary: Summary) -> str:
    """Describes steal time if it may be the cause."""
    steal = summary.number("host_steal_percent")
    if steal is None or steal < NOTABLE_STEAL_PERCENT:
        return ""
    return f" (steal: neighbors took {steal:.1f} % of this host's CPU time)"
