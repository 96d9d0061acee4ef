# SPDX-License-Identifier: Apache-2.0
"""`slambed results`: shows the size of runs, removes those in no plan, packs them, and plays some
again to compare."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from slambed.commands.shared_options import JobsOption
from slambed.errors import ExitCode, SlambedError
from slambed.failures import INTERRUPTED
from slambed.terminal import RESULTS, JsonOption, ResultsOption, console, print_json

app = typer.Typer(help="What is kept of runs, and what it takes.", no_args_is_help=True)


@app.command()
def size(results: ResultsOption = RESULTS, as_json: JsonOption = False) -> None:
    """Show how much space the runs of each experiment take, and those that no experiment uses."""
    from slambed.campaign.size import plans, size_of, unnamed
    from slambed.campaign.store import RunStore

    _must_be_there(results)
    store = RunStore(results)
    if as_json:
        of_each = {name: asdict(size_of(store, keys)) for name, keys in plans(results)}
        free = asdict(size_of(store, unnamed(results)))
        print_json({"experiments": of_each, "in_no_plan": free})
        return
    for name, keys in plans(results):
        typer.echo(f"{name}: {size_of(store, keys)}")
    unused = size_of(store, unnamed(results))
    typer.echo(f"used by no experiment: {unused}; free them: slambed results prune")


@app.command()
def prune(
    results: ResultsOption = RESULTS,
    other_settings: Annotated[
        bool,
        typer.Option(
            "--other-settings", help="Also those made with other settings, as with run --set."
        ),
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Really remove them.")] = False,
) -> None:
    """Remove runs that no experiment here uses any more, for example of older sources.

    Runs made with other settings than those of the last plan stay: 'slambed run' with the earlier
    settings takes them again. Runs of a system or variant that the experiment no longer names do
    not stay.
    """
    from slambed.campaign.folder import ResultFolder
    from slambed.campaign.size import plans, size_of, unnamed_by_reason
    from slambed.campaign.store import RunStore

    _must_be_there(results)
    store = RunStore(results)
    chosen: set[str] = set()
    for reason, keys in unnamed_by_reason(results).items():
        stays = reason.can_return and not other_settings
        chosen |= set() if stays else keys
        kept = "; they stay without --other-settings" if stays else ""
        typer.echo(f"{reason}: {size_of(store, keys)}{kept}")
    total = size_of(store, chosen)
    if not yes:
        typer.echo(f"would remove {total}; give --yes to do it")
        return
    for key in chosen:
        store.remove(key)
    for name, named in plans(results):
        ResultFolder(results / name).show(named)
    typer.echo(f"removed {total}")


@app.command("pack")
def pack_command(
    names: Annotated[
        list[str] | None, typer.Argument(help="Experiments whose runs go into it; all if none.")
    ] = None,
    *,
    output: Annotated[Path, typer.Option("--output", "-o", help="File to write (.tar.xz).")],
    whole: Annotated[
        bool, typer.Option("--whole", help="With events, samples and paths, not numbers only.")
    ] = False,
    events: Annotated[
        list[str] | None,
        typer.Option("--events", help="Also keep events of this type; repeatable."),
    ] = None,
    results: ResultsOption = RESULTS,
) -> None:
    """Write the valid runs of experiments into one small file: results and conditions."""
    from slambed.campaign.pack import pack
    from slambed.campaign.size import plans

    if whole and events:
        raise SlambedError("--whole keeps all events; leave out --events")
    _must_be_there(results)
    chosen = names or [name for name, _ in plans(results)]
    done = pack(results, chosen, output, whole, sorted(set(events or [])))
    kept = "".join(f", {count} events {kind}" for kind, count in done.events.items())
    typer.echo(f"{output}: {done.runs} runs, {done.size_bytes / 1e6:.2f} MB{kept}")


@app.command("unpack")
def unpack_command(
    file: Annotated[Path, typer.Argument(help="What `slambed results pack` wrote.")],
    results: ResultsOption = RESULTS,
) -> None:
    """Unpack the runs of a packed file into a results folder; `run` and `report` can use them."""
    from slambed.campaign.pack import unpack

    found, new = unpack(file, results)
    typer.echo(f"{file}: {found} runs, {new} of them new in {results}")


@app.command("replay")
def replay_command(
    what: Annotated[
        str, typer.Argument(help="A packed file (.tar.xz), or an experiment with results.")
    ],
    *,
    runs: Annotated[int, typer.Option(min=1, help="How many runs to draw.")] = 10,
    seed: Annotated[int, typer.Option(help="Seed of the draw; the same draws the same runs.")] = 1,
    experiment: Annotated[
        list[str] | None,
        typer.Option(help="File of an experiment in the packed file that is not one of slambed's."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="KEY=VALUE as given to `slambed run`; repeatable."),
    ] = None,
    jobs: JobsOption = None,
    results: ResultsOption = RESULTS,
) -> None:
    """Play some virtual runs again, drawn at random, and compare them with what is there.

    Every file that the packed file or the results folder has of these runs is compared, apart from
    manifests, which tell when and where, logs and pictures. Accuracies may differ in their last
    digits, as they do between kinds of processors, and the last line says in how many runs they do.
    Nothing is written into the results. Exits with 1 unless all are the same: where a file differs,
    or where a run cannot be played here, for example because other sources made it.
    """
    import tempfile

    from slambed.campaign.pack import extract
    from slambed.campaign.replay import draw, replay
    from slambed.campaign.size import plans
    from slambed.spec.library import Library

    screen = console()
    files = {Library().experiment(file)[0].id: file for file in experiment or []}
    with tempfile.TemporaryDirectory(prefix="slambed-packed.") as place:
        if _is_packed(what):
            before = Path(place)
            extract(Path(what), before)
            names = [name for name, _ in plans(before)]
            if unknown := files.keys() - set(names):
                raise SlambedError(
                    f"{what} has no runs of {', '.join(sorted(unknown))}; its experiments are "
                    f"{', '.join(names)}"
                )
        else:
            if files:
                raise SlambedError(f"--experiment is for packed files; {what} is none")
            before = results
            _must_be_there(results)
            names = [Library().experiment(what)[0].id]
            files[names[0]] = what
        drawn = draw(before, names, runs, seed)
        found = replay(before, drawn, files, settings or [], jobs, screen)
    if found.interrupted:
        typer.echo("interrupted; nothing is kept, the same command begins again", err=True)
        raise typer.Exit(INTERRUPTED)
    for run, why in found.left_out.items():
        typer.echo(f"not compared: {run}: {why}")
    for run, different in found.different.items():
        typer.echo(f"different: {run}: {', '.join(different)}")
    digits = f"; accuracies of {found.digits} have other last digits" if found.digits else ""
    result = f"{len(found.same)} of {len(drawn)} runs are the same, in {found.files} files{digits}"
    if len(found.same) < len(drawn):
        differ = f"; {len(found.different)} differ" if found.different else ""
        left_out = f"; {len(found.left_out)} not compared" if found.left_out else ""
        raise SlambedError(f"{what}: {result}{differ}{left_out}", ExitCode.NOT_ALL_GOOD)
    typer.echo(result)


def _is_packed(what: str) -> bool:
    """Returns whether this names a packed file rather than an experiment."""
    if what.endswith((".tar.xz", ".txz")):
        return True
    return Path(what).is_file() and not what.endswith((".yaml", ".yml"))


def _must_be_there(results: Path) -> None:
    if not results.is_dir():
        raise SlambedError(f"no such folder: {results}; give the right --results")
