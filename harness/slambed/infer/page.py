# SPDX-License-Identifier: Apache-2.0
"""Writes the result of an inference: one self-contained page, and the same as JSON."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup

from slambed.files.atomic import replacing
from slambed.files.outputs import make_folder
from slambed.infer.design import shown
from slambed.infer.inference import Back, Outcome, described
from slambed.infer.mixture import best_possible
from slambed.infer.search import Evaluated
from slambed.infer.success import ComparedCell
from slambed.infer.svg_figures import Lane, lanes_svg, profile_svg
from slambed.papers.environment import environment
from slambed.papers.judged import printed as printed_text
from slambed.papers.strip import COLORS
from slambed.papers.verdicts.model import Mean, Share
from slambed.report.page import STYLE

PAGE = "index.html"
NUMBERS = "inference.json"


@dataclass(frozen=True)
class Row:
    """A published number and its prediction."""

    id: str
    label: str
    paper: str
    predicted: str
    ours: str
    mark: str
    """`in`, `out` or `not run`."""


def headline(outcome: Outcome) -> list[str]:
    """Returns the result in a few lines."""
    met = sum(item.met for item in outcome.success)
    conclusion = "not reproduced"
    if met == len(outcome.success):
        conclusion = "reproduced by the plan's own words"
        if outcome.stand_ins:
            conclusion = (
                "but on a substitute of the paper's sequence, so nothing is called reproduced"
            )
    found = [f"{met} of {len(outcome.success)} criteria of the plan are met: {conclusion}"]
    found += [
        f"  {'met' if m.met else 'NOT MET'}: {m.criterion.says} ({m.why})" for m in outcome.success
    ]
    for name, cells in (("fitted", outcome.fitted), ("held out", outcome.held_out)):
        inside = sum(c.prediction is not None and c.prediction.inside for c in cells)
        found.append(
            f"{name}: {inside} of {len(cells)} cells inside their 95 % predictive interval"
        )
    best = outcome.fit.best
    found.append(
        f"likeliest point ({outcome.kept} of {len(outcome.fit.points)} kept): {best.point.words()}"
    )
    return found + [line.text for line in outcome.lines]


def write_page(outcome: Outcome, folder: Path) -> Path:
    """Writes `index.html` and `inference.json`; returns the page."""
    make_folder(folder, "--results")
    for name, text in ((NUMBERS, _numbers(outcome)), (PAGE, _page(outcome))):
        with replacing(folder / name) as out:
            out.write_text(text, encoding="utf-8")
    return folder / PAGE


def _page(outcome: Outcome) -> str:
    plan, fit = outcome.plan, outcome.fit
    fitted, held_out = _rows(outcome, outcome.fitted), _rows(outcome, outcome.held_out)
    cells = list(fit.printed)
    template = environment("slambed.infer").get_template("inference.html.j2")
    return template.render(
        style=Markup(STYLE),
        colors=COLORS,
        plan=plan,
        paper=outcome.places.paper.paper,
        digest=outcome.registration.digest,
        form="quick form" if outcome.quick else "full form",
        command=f"slambed infer {plan.id}{' --quick' if outcome.quick else ''}",
        spent=outcome.spent,
        headline=headline(outcome)[0],
        success=outcome.success,
        bad=[line.text for line in outcome.lines if line.bad],
        good=[line.text for line in outcome.lines if not line.bad],
        failures=_failures(outcome),
        stand_ins=outcome.stand_ins,
        open=[(name, described(plan, name), item.says) for name, item in plan.open.items()],
        unfitted=outcome.unfitted,
        profiles=[profile_svg(name, item, fit) for name, item in plan.open.items()],
        fitted=fitted,
        held_out=held_out,
        fitted_lanes=lanes_svg(_lanes(outcome, outcome.fitted), "fitted shares"),
        held_lanes=lanes_svg(_lanes(outcome, outcome.held_out), "shares held out"),
        names=list(plan.open),
        kept=[_point(e, fit.best, w) for e, w in zip(fit.kept, fit.weights, strict=True)],
        points=[_point(e, fit.best, None) for e in fit.ranked],
        predicting=outcome.predicting,
        within=plan.within_log,
        reachable=best_possible(fit.printed, fit.best.runs) - fit.best.log_likelihood,
        back_cells=[_label(outcome, c) for c in cells],
        paper_counts=[f"{s.bad}/{s.runs}" for s in fit.printed.values()],
        best_counts=[_count(fit.best, c) for c in cells],
        back_runs=fit.best.runs,
        back=[_back(b, fit.best, cells) for b in outcome.back],
        printed=_back(Back("all of them", "", "", outcome.printed), fit.best, cells),
    )


def _failures(outcome: Outcome) -> list[str]:
    """Returns one sentence per failure."""
    found = [f"{m.criterion.says}: not met ({m.why})." for m in outcome.success if not m.met]
    for name, cells in (("Fitted", outcome.fitted), ("Held out", outcome.held_out)):
        for row in _rows(outcome, cells):
            if row.mark == "out":
                found.append(
                    f"{name}, {row.label}: printed {row.paper}, predicted {row.predicted}."
                )
            elif row.mark != "in":
                found.append(f"{name}, {row.label}: not run.")
    if outcome.predicting < outcome.kept:
        message = (
            f"{outcome.predicting} of {outcome.kept} kept points predict: the budget is spent."
        )
        found.append(message)
    if outcome.fit.unpaid:
        message = f"{outcome.fit.unpaid} times a point that may have been kept got no more runs"
        found.append(f"{message}: the budget is spent.")
    return [*found, *(f"A run without a result: {line}" for line in outcome.failures)]


def _label(outcome: Outcome, cell: str) -> str:
    found = outcome.places.places[cell].cell
    if found.claim is not None:
        system = outcome.places.paper.systems.get(str(found.system))
        at = [str(v) for k, v in found.conditions.items() if k not in ("dataset", "runs")]
        return ", ".join([system.label if system else str(found.system), *at])
    return f"{found.row}, {found.column}" if found.column else found.row


def _lanes(outcome: Outcome, cells: list[ComparedCell]) -> list[Lane]:
    return [Lane(_label(outcome, b.cell), b) for b in cells]


def _rows(outcome: Outcome, cells: list[ComparedCell]) -> list[Row]:
    return [_row(outcome, b) for b in cells]


def _row(outcome: Outcome, compared: ComparedCell) -> Row:
    cell = outcome.places.places[compared.cell].cell
    found, printed = compared.prediction, compared.printed
    predicted, mark = "-", "not run"
    paper = printed_text(cell)
    if isinstance(printed, Share):
        paper = f"{printed.bad} of {printed.runs}"
    if found is not None:
        mark = "in" if found.inside else "out"
        digits = 0 if isinstance(printed, Share) else 2
        spread = f"{found.low:.{digits}f} to {found.high:.{digits}f}"
        predicted = f"{found.expected:.{max(1, digits)}f} ({spread})"
    ours = "-"
    if isinstance(compared.ours, Share):
        ours = f"{compared.ours.bad} of {compared.ours.runs}"
    elif compared.ours is not None:
        mean = Mean.of(compared.ours)
        ours = f"{mean.value:.4g} (n {mean.count})"
    return Row(compared.cell, _label(outcome, compared.cell), paper, predicted, ours, mark)


def _point(evaluated: Evaluated, best: Evaluated, weight: float | None) -> dict[str, Any]:
    return {
        "values": [shown(value) for _, value in evaluated.point.values],
        "runs": evaluated.runs,
        "below": f"{evaluated.log_likelihood - best.log_likelihood:.1f}",
        "weight": "" if weight is None else f"{weight:.2f}",
    }


def _back(back: Back, best: Evaluated, cells: list[str]) -> dict[str, Any]:
    return {
        "item": back.item,
        "best": back.best,
        "printed": back.printed,
        "buys": f"{best.log_likelihood - back.evaluated.log_likelihood:.1f}",
        "counts": [_count(back.evaluated, c) for c in cells],
    }


def _count(evaluated: Evaluated, cell: str) -> str:
    share = evaluated.counts[cell]
    return f"{share.bad}/{share.runs}"


def _numbers(outcome: Outcome) -> str:
    """Returns every number of the page as JSON, for other plots."""

    def compared_cell(item: ComparedCell) -> dict[str, Any]:
        found, printed = item.prediction, item.printed
        share = isinstance(printed, Share)
        return {
            "cell": item.cell,
            "printed": printed.bad if isinstance(printed, Share) else printed.value,
            "printed_runs": printed.runs if isinstance(printed, Share) else printed.count,
            "is_count": share,
            "expected": found.expected if found else None,
            "low": found.low if found else None,
            "high": found.high if found else None,
            "position": found.position if found else None,
            "inside": found.inside if found else None,
        }

    def point(item: Evaluated) -> dict[str, Any]:
        counts = {c: [s.bad, s.runs] for c, s in item.counts.items()}
        return {
            "values": item.point.named, "runs": item.runs, "counts": counts,
            "log_likelihood": item.log_likelihood,
        }  # fmt: skip

    kept = {e.point for e in outcome.fit.kept}
    content = {
        "plan": outcome.plan.id,
        "digest": outcome.registration.digest,
        "commit": outcome.registration.commit,
        "registered": not any(line.bad for line in outcome.lines),
        "registration": [line.text for line in outcome.lines],
        "quick": outcome.quick,
        "stand_ins": outcome.stand_ins,
        "runs": outcome.spent,
        "points": [{**point(e), "kept": e.point in kept} for e in outcome.fit.ranked],
        "fitted": [compared_cell(b) for b in outcome.fitted],
        "held_out": [compared_cell(b) for b in outcome.held_out],
        "attribution": [
            {"item": b.item, "best": b.best, "printed": b.printed, **point(b.evaluated)}
            for b in outcome.back
        ],
        "all_as_printed": point(outcome.printed),
        "success": [
            {"says": m.criterion.says, "met": m.met, "why": m.why} for m in outcome.success
        ],
        "failures": _failures(outcome),
    }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"
