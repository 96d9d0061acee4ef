# SPDX-License-Identifier: Apache-2.0
"""`slambed report --losses`: tables of an experiment's track losses by cause."""

from dataclasses import dataclass
from statistics import median

from slambed.metrics.losses import BEHIND_UPDATE_S, EVENTS, Cause, TrackLoss, losses_of, sentence
from slambed.metrics.statistics import wilson
from slambed.report.load import Results
from slambed.report.tables import Table

MOST_TIMES = 12
AFTER_RECOVERY_S = 2.0
"""A loss by a map update within this time after a relocalization makes that relocalization useless
(IJNC)."""


@dataclass(frozen=True)
class LostRun:
    """The losses of one run."""

    cell: str
    run_key: str
    repetition: int
    losses: list[TrackLoss]


def lost_runs(results: Results) -> list[LostRun]:
    """Returns every valid run with events, also those without a loss, in the order of the
    summary."""
    runs = []
    for row in results.valid_runs.to_dict("records"):
        log = results.events(str(row["run_key"]), EVENTS)
        if log is not None:
            found = losses_of(log)
            key = str(row["run_key"])
            runs.append(LostRun(str(row["cell"]), key, int(row["repetition"]), found))
    return runs


def _behind_update(loss: TrackLoss) -> bool:
    return loss.update_s is not None and loss.update_s <= BEHIND_UPDATE_S


def _takes_recovery_away(loss: TrackLoss) -> bool:
    """Returns whether an update after a relocalization caused the loss within AFTER_RECOVERY_S."""
    if loss.update_s is None or loss.found_s is None or not _behind_update(loss):
        return False
    return loss.update_s < loss.found_s <= AFTER_RECOVERY_S


def _causes_of(losses: list[TrackLoss]) -> list[Cause]:
    """Returns the causes that occur; a table has no column for others."""
    return [cause for cause in Cause if any(loss.cause is cause for loss in losses)]


def _counts(losses: list[TrackLoss], causes: list[Cause]) -> list[str]:
    """Counts the losses by cause; empty for zero."""
    return [str(sum(loss.cause is cause for loss in losses) or "") for cause in causes]


def by_cause(runs: list[LostRun]) -> Table:
    """Returns per cell the runs that lost track, and the causes of their first losses."""
    causes = _causes_of([run.losses[0] for run in runs if run.losses])
    table = Table(
        "losses",
        "What the first loss of each run followed from, and when (sequence time in s).",
        ["cell", "lost", "95 %", *map(str, causes), "behind an update", "first at"],
    )
    for cell in dict.fromkeys(run.cell for run in runs):
        own = [run for run in runs if run.cell == cell]
        firsts = [run.losses[0] for run in own if run.losses]
        share = wilson(len(firsts), len(own))
        behind = sum(map(_behind_update, firsts))
        table.rows.append(
            [
                cell,
                f"{len(firsts)}/{len(own)}",
                f"{share.low:.0%} to {share.high:.0%}",
                *_counts(firsts, causes),
                f"{behind}/{len(firsts)}" if firsts else "",
                _times([loss.seq_s for loss in firsts]),
            ]
        )
    return table


def all_by_cause(runs: list[LostRun]) -> Table:
    """Returns the causes of all losses per cell."""
    causes = _causes_of([loss for run in runs for loss in run.losses])
    table = Table(
        "all_losses",
        f"What every loss followed from; relocalized: within {AFTER_RECOVERY_S:g} s of a "
        "relocalization, right behind an update that came in between.",
        ["cell", "losses", "per run", *map(str, causes), "behind an update", "relocalized"],
    )
    for cell in dict.fromkeys(run.cell for run in runs):
        each = [run.losses for run in runs if run.cell == cell]
        every = [loss for losses in each for loss in losses]
        numbers = [len(losses) for losses in each]
        table.rows.append(
            [
                cell,
                str(len(every)),
                f"{median(numbers):g} ({min(numbers)} to {max(numbers)})",
                *_counts(every, causes),
                str(sum(map(_behind_update, every))),
                str(sum(map(_takes_recovery_away, every))),
            ]
        )
    return table


def _times(times_s: list[float]) -> str:
    shown = [f"{time_s:.1f}" for time_s in sorted(times_s)]
    more = [f"and {len(shown) - MOST_TIMES} more"] if len(shown) > MOST_TIMES else []
    return " ".join(shown[:MOST_TIMES] + more)


def every_loss(runs: list[LostRun]) -> Table:
    """Returns one row per loss."""
    table = Table(
        "every_loss",
        "Every loss with what preceded it.",
        [
            "cell",
            "run",
            "repetition",
            "number",
            "seq_s",
            "cause",
            "missing_frames",
            "found_s",
            "update_s",
            "update_pause_ms",
            "gap_keyframes",
            "inliers",
            "motion_matches",
            "word_matches",
            "reference_matches",
            "why",
        ],
        words=2,
    )
    for run in runs:
        for number, loss in enumerate(run.losses, 1):
            known = (
                loss.missing_frames, loss.found_s, loss.update_s, loss.update_pause_ms,
                loss.gap_keyframes, loss.inliers, loss.motion_matches, loss.word_matches,
                loss.reference_matches,
            )  # fmt: skip
            table.rows.append(
                [
                    run.cell,
                    run.run_key,
                    str(run.repetition),
                    str(number),
                    f"{loss.seq_s:.3f}",
                    str(loss.cause),
                    *("" if v is None else f"{v:g}" for v in known),
                    sentence(loss),
                ]
            )
    return table
