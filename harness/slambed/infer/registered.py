# SPDX-License-Identifier: Apache-2.0
"""Checks that a plan was written and committed before its runs.

The digest covers everything that could be changed to fit a result: the plan, its experiments, and
the paper's printed numbers and mapping. The manifest of every run has it, with the commit that held
those files unchanged when the run was made.
"""

import hashlib
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from slambed.files.yaml_source import YamlSource
from slambed.infer.inference_plan import Inference
from slambed.infer.slots import Places
from slambed.papers.published import frozen_digest
from slambed.papers.published.paper_plan import DIGITS
from slambed.papers.registered import PlanLine, written_in
from slambed.spec.run_spec import canonical_json

SHORT_COMMIT = 10
"""Characters of a commit hash in a sentence."""


@dataclass(frozen=True)
class Registration:
    """The digest of a plan, and the commit that has it."""

    name: str
    """Key in the manifests."""
    digest: str
    commit: str | None
    """HEAD, if it has the files unchanged; None if one is changed, or not in git."""
    why: str = ""
    """Why there is no such commit."""

    @property
    def entry(self) -> dict[str, dict[str, str]]:
        commit = {} if self.commit is None else {"commit": self.commit}
        return {self.name: {"plan": self.digest, **commit}}


def register(plan: Inference, source: YamlSource, paper_file: Path, places: Places) -> Registration:
    """Registers the current content of the plan."""
    content = {
        "plan": plan.model_dump(mode="json", exclude_defaults=True),
        "paper": frozen_digest(places.paper),
        "experiments": {name: base.source.data for name, base in places.bases.items()},
    }
    digest = hashlib.sha256(canonical_json(content).encode()).hexdigest()[:DIGITS]
    files = [source.path, paper_file]
    files += [base.source.path for base in places.bases.values()]
    commit, why = commit_of(files)
    return Registration(f"inference/{plan.id}", digest, commit, why)


def commit_of(files: list[Path]) -> tuple[str | None, str]:
    """Returns HEAD of the repository of these files if it has all of them unchanged, else the
    reason why not."""
    head = None
    for path in files:
        folder = str(path.resolve().parent)
        # Under sudo the checkout belongs to another user, which git refuses without this.
        git = ["git", "-c", "safe.directory=*", "-C", folder]
        name = path.resolve().name
        try:
            found = _output([*git, "rev-parse", "HEAD"])
            tracked = _output([*git, "ls-files", "--", name])
            changed = _output([*git, "status", "--porcelain", "--", name])
        except (OSError, subprocess.CalledProcessError):
            return None, f"{path.name} is in no git repository"
        if not tracked:
            return None, f"{path.name} is not committed"
        if changed:
            return None, f"{path.name} has changes that are not committed"
        head = head or found
    return head, ""


def _output(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def registered_lines(registration: Registration, runs: pd.DataFrame) -> list[PlanLine]:
    """Returns sentences about whether these runs keep to the plan."""
    name, digest = registration.name, registration.digest
    total = len(runs)
    plans = written_in(runs, f"plan.{name}")
    unknown = plans.pop("", 0)
    own = plans.pop(digest, 0)
    found = []
    if registration.commit is None:
        message = f"Plan {digest} is not registered: {registration.why}."
        found.append(PlanLine(message, bad=True))
    if plans:
        others = ", ".join(sorted(plans))
        message = f"{sum(plans.values())} of {total} runs were made under another plan: {others}."
        found.append(PlanLine(message, bad=True))
    if unknown:
        message = f"{unknown} of {total} runs do not say that they were made under this plan."
        found.append(PlanLine(message, bad=True))
    if own:
        column = f"plan.{name}"
        commits = written_in(runs[runs[column].eq(digest)], f"plan_commit.{name}")
        if loose := commits.pop("", 0):
            message = f"{loose} of {own} runs were made before the plan was committed as it is."
            found.append(PlanLine(message, bad=True))
        for commit, count in sorted(commits.items()):
            message = f"Plan {digest} was committed unchanged ({commit[:SHORT_COMMIT]}) before"
            found.append(PlanLine(f"{message} {count} of {total} runs were made."))
    return found
