# SPDX-License-Identifier: Apache-2.0
"""The YAML of an inference: open items, fitted and predicted numbers, and success criteria."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from slambed.errors import SlambedError
from slambed.files.names import Name, Title
from slambed.files.yaml_source import YamlSource, load_yaml, parse
from slambed.infer.keys import split_key
from slambed.papers.published import Paper, paper_files, papers_folder, read_paper, read_papers
from slambed.papers.published.braces import expanded
from slambed.spec.system import Scalar
from slambed.suggestion import suggestion

STRICT = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
FOLDER = "inference"
"""Subfolder of a paper's folder."""
YAML = (".yaml", ".yml")
QUICK = "-quick"
"""Suffix of the folder of a quick form."""


def _each_once(patterns: list[str]) -> list[str]:
    found = [cell for pattern in patterns for cell in expanded(pattern)]
    if len(set(found)) < len(found):
        twice = next(cell for cell in found if found.count(cell) > 1)
        raise ValueError(f"{twice} is named twice")
    return found


Cells = Annotated[list[str], AfterValidator(_each_once)]
"""Ids of published numbers; braces expand to several (`T2.x.rtt{0,20}`)."""


class Change(BaseModel):
    """Variant and parameters that replace a system's, in one case or at every point."""

    model_config = STRICT

    variant: str | None = None
    """Variant of the system; null keeps it."""
    params: dict[str, Scalar] = Field(default_factory=dict)
    """Parameter -> value, instead of the experiment's."""


class OpenItem(BaseModel):
    """One item that the paper leaves open: a range, a list of values, or cases that change several
    things."""

    model_config = STRICT

    says: str
    """What it is, and where the paper leaves it open."""
    set: str | None = None
    """Key that the values set: `params.<name>`, `devices.<role>`,
    `devices.<role>.<cores|speed|background|jitter.<stage>>`, `datasets.<name>` or
    `profiles.<name>`; absent with cases."""
    range: list[float | int] | None = Field(default=None, min_length=2, max_length=2)
    """Lowest and highest value; only integers are drawn if both are integers."""
    values: list[Scalar] | None = None
    """Values to choose from."""
    cases: dict[str, dict[str, Change]] | None = None
    """Maps a case's name to changes of the paper's systems (patterns)."""
    systems: list[str] | None = Field(default=None, min_length=1)
    """The paper's systems (patterns) that it applies to; default: all it can apply to."""
    printed: Scalar
    """The value without a fit: what the paper prints, or the usual one."""

    @model_validator(mode="after")
    def _one_form(self) -> "OpenItem":
        if [self.range, self.values, self.cases].count(None) != 2:
            raise ValueError("give one of range, values, cases")
        if (self.set is None) != (self.cases is not None):
            raise ValueError("set belongs to range and values, and cases set what they name")
        if self.set is not None:
            split_key(self.set)
        if self.range is not None and not self.range[0] < self.range[1]:
            low, high = self.range
            raise ValueError(f"range {low:g} to {high:g} is reversed or empty")
        if self.range is not None and (isinstance(self.printed, bool | str)):
            raise ValueError(f"printed {self.printed!r} is no number")
        if self.range is None:
            if len({str(v) for v in self.choices}) < max(2, len(self.choices)):
                raise ValueError("something open has two values at least, each once")
            if self.cases is not None and self.printed not in self.cases:
                raise ValueError(f"printed {self.printed!r} is none of {', '.join(self.cases)}")
        return self

    @property
    def choices(self) -> list[Scalar]:
        """Returns the values to choose from; empty for a range."""
        return list(self.cases) if self.cases is not None else list(self.values or [])


class Form(BaseModel):
    """How many points are tried, and how many runs each one gets."""

    model_config = STRICT

    points: int = Field(ge=2, le=4096)
    """Number of points, spread over the open items; includes the printed point."""
    first_runs: int = Field(ge=5)
    """Runs of every fitted cell in the first round. Each later round doubles them, for points that
    may still be kept."""
    final_runs: int = Field(ge=5)
    """Runs of every fitted cell in the last round."""
    predict_runs: int = Field(ge=5)
    """Runs of every predicted cell."""
    budget_runs: int = Field(ge=1)
    """Most runs of fit and predictions together; attribution runs come on top."""

    @model_validator(mode="after")
    def _grows(self) -> "Form":
        if self.final_runs < self.first_runs:
            raise ValueError(f"final_runs {self.final_runs} is below first_runs {self.first_runs}")
        return self


class Criterion(BaseModel):
    """One criterion of success."""

    model_config = STRICT

    says: str
    """The criterion in one sentence."""
    kind: Literal["fitted_inside", "held_out_inside", "mean_error", "rank", "rises"]
    """fitted_inside, held_out_inside: share of cells inside their 95 % predictive intervals;
    mean_error: mean error in points; rank: Spearman's rank correlation of ours with the paper's
    over `cells`; rises: every cell of `cells` is above the one before in the runs of the best point
    (one-sided, p < 0.05 each)."""
    at_least: float | None = None
    """Smallest value that passes; not for `mean_error` and `rises`."""
    at_most: float | None = None
    """Largest value that passes; of `mean_error` only."""
    cells: Cells = Field(default_factory=list)
    """Cells in order, for `rank` and `rises`."""

    @model_validator(mode="after")
    def _is_whole(self) -> "Criterion":
        wanted = {"mean_error": "at_most", "rises": None}.get(self.kind, "at_least")
        given = {name for name in ("at_least", "at_most") if getattr(self, name) is not None}
        if given != ({wanted} if wanted else set()):
            raise ValueError(f"{self.kind} takes {wanted or 'neither at_least nor at_most'}")
        needed = {"rises": 2, "rank": 3}.get(self.kind, 0)
        if len(self.cells) < needed or (self.cells and not needed):
            raise ValueError(
                f"{self.kind} takes {f'{needed} cells at least' if needed else 'no cells'}"
            )
        return self


class Inference(BaseModel):
    """One plan of an inference."""

    model_config = STRICT

    id: Name
    """Name of the plan, as of its file."""
    title: Title
    """Heading of its page."""
    paper: str
    """Name in papers/, or a .yaml file next to the plan."""
    experiments: list[str] = Field(min_length=1)
    """Names, or files next to the plan. Their cells are compared with the paper's; for each number,
    the first experiment that reproduces its table and has such runs is used."""
    playback: dict[str, Any] = Field(default_factory=dict)
    """Keys of `playback` that replace those of the experiments."""
    instead: dict[str, Change] = Field(default_factory=dict)
    """Maps the paper's systems (patterns) to changes that apply at every point."""
    open: dict[str, OpenItem]
    """Name -> what the paper leaves open."""
    fit: Cells = Field(min_length=1)
    """Cells of the paper that the open values are fitted to."""
    held_out: Cells = Field(min_length=1)
    """Cells of the paper that are predicted."""
    within_log: float = Field(default=2.0, gt=0)
    """Points within this log-likelihood of the best one are kept and used for predictions."""
    seed: int = Field(ge=0, lt=2**31)
    """Seed of the spread of points and of the runs."""
    full: Form
    """How much is run."""
    quick: Form
    """How much is run with `--quick`."""
    success: list[Criterion] = Field(min_length=1)
    """What has to hold for the inference to succeed."""
    limits: list[str] = Field(default_factory=list)
    """What the inference cannot show, and why."""

    def form(self, quick: bool) -> Form:
        return self.quick if quick else self.full

    @model_validator(mode="after")
    def _is_an_inference(self) -> "Inference":
        if not self.open:
            raise ValueError("nothing is open: there is nothing to infer")
        if both := [cell for cell in self.held_out if cell in self.fit]:
            raise ValueError(f"{both[0]} is held out and fitted too: a fitted cell is no evidence")
        for criterion in self.success:
            for cell in criterion.cells:
                if cell not in (*self.fit, *self.held_out):
                    raise ValueError(
                        f"success asks for {cell}, which is neither fitted nor held out"
                    )
        return self


def plan_files() -> dict[str, Path]:
    """Maps the name of every plan of the checkout to its file."""
    return {path.stem: path for path in sorted(papers_folder().glob(f"*/{FOLDER}/*.yaml"))}


def find_plan(name: str) -> tuple[Inference, YamlSource]:
    """Finds a plan by name (in papers/*/inference/) or by path (.yaml or .yml). Raises SlambedError
    with file, line and reason if it is invalid."""
    if name.endswith(YAML):
        path = Path(name)
    else:
        files = plan_files()
        if name not in files:
            former = papers_folder().with_name(FOLDER) / f"{name}.yaml"
            if former.is_file():
                what_now = f"move it to {papers_folder()}/<paper>/{FOLDER}"
                raise SlambedError(f"unknown plan '{name}': {former} is no longer read, {what_now}")
            wanted = papers_folder() / "*" / FOLDER / f"{name}.yaml"
            raise SlambedError(f"unknown plan '{name}', no {wanted}; {suggestion(name, files)}")
        path = files[name]
    source = load_yaml(path)
    plan = parse(Inference, source)
    if plan.id != path.stem:
        message = f"id '{plan.id}' is not the file's name"
        raise source.complaint(message, ("id",), f"write id: {path.stem}")
    return plan, source


def read_its_paper(plan: Inference, source: YamlSource) -> tuple[Paper, Path]:
    """Returns the paper of a plan, and its file."""
    if plan.paper.endswith(YAML):
        path = source.path.parent / plan.paper
        return read_paper(path), path
    return read_papers([plan.paper])[0], paper_files()[plan.paper]
