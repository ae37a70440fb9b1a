"""explore3d batch: many logs into one store."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from explore3d import UnitError, UserError, count_text, parse_time, seconds_text
from explore3d.cli.options import Columns, Force, Frame, Json, Part, Pixel, TipRadius, Tolerances, Units

if TYPE_CHECKING:
    from explore3d.jobs.batch import Standing

# Failures that are listed one by one; the store has them all
MOST_LISTED_FAILURES = 10
# Seconds between two lines of progress where there is no terminal
LINE_EVERY = 5.0
BYTE_UNITS = {"kB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}


def batch(
    logs: Annotated[
        list[str] | None,
        typer.Argument(metavar="PATTERN...", help="Files, folders, patterns in quotes, addresses (s3://...)."),
    ] = None,
    out: Annotated[
        str, typer.Option("--out", "-o", help="The store: a folder, or an address; it is appended to.")
    ] = "",
    manifest: Annotated[
        Path | None, typer.Option(help="CSV: file, object, tip_radius, units, ... a row a log (docs/batch.md).")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Existence, places and sizes alone: no chains.")] = False,
    tip_radius: TipRadius = None,
    tip_sd: Annotated[str | None, typer.Option(help="Standard deviation of that radius.")] = None,
    form: Annotated[str | None, typer.Option(help="Shape of a fitted base, as for analyze.")] = None,
    tolerances: Tolerances = None,
    units: Units = None,
    columns: Columns = None,
    pixel: Pixel = None,
    part: Part = None,
    frame: Frame = None,
    model: Annotated[Path | None, typer.Option(help="Mesh of the global model of all of them.")] = None,
    model_units: Annotated[str, typer.Option(help="Unit of that mesh's coordinates.")] = "m",
    force: Force = None,
    time_limit: Annotated[str | None, typer.Option(help='What one log may take, "60 s".')] = None,
    memory_limit: Annotated[str | None, typer.Option(help='What one log may hold in memory, "2 GB".')] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes on this machine; one a core.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Of a Dask scheduler (extra cluster): tcp://host:8786.")
    ] = None,
    models: Annotated[bool, typer.Option("--models", help="Keep the model and the report of each log, too.")] = False,
    retry: Annotated[bool, typer.Option("--retry", help="Do those again that have no result in the store.")] = False,
    json: Json = False,
) -> None:
    """Analyse many logs, each on its own, into a store of two tables: runs and features.

    What stands in the store with equal bytes, version and settings is skipped.

    Example: explore3d batch "scans/*.csv" --tip-radius "2 um" --units mm --out store
    """
    from json import dumps

    from explore3d.jobs import Told
    from explore3d.jobs.batch import Limits, batch as carry_out, tasks_of
    from explore3d.log.table import load_settings
    from explore3d.scene import read_tolerances

    if not out:
        raise UserError("--out is missing: the folder or address of the store")
    origin = None if frame is None else {"origin": [each.strip() for each in frame.split(",")]}
    table: dict[str, Any] = {"tip_sd": tip_sd, "form": form, "units": units, "columns": columns}
    table |= {"pixel": pixel, "part": part, "frame": origin}
    said = {name: value for name, value in table.items() if value is not None}
    load_settings(Path("the command's options"), tip_radius=tip_radius, **said)
    if tolerances is not None:
        read_tolerances(tolerances)
        said["tolerances"] = str(tolerances.resolve())
    told = Told(tip_radius, model, model_units, tuple(force or ()), quick, said)
    if model is not None and not model.is_file():
        raise UserError(f"--model {model}: no such mesh file")
    limits = Limits(_seconds(time_limit), _bytes(memory_limit))
    tasks = tasks_of(logs or [], told, manifest)
    with _shown(quiet=json) as tell:
        result = carry_out(
            tasks, out, limits=limits, workers=workers, scheduler=scheduler, models=models, retry=retry, tell=tell
        )
    if json:
        print(dumps(result.record(), ensure_ascii=False))
        return
    told_of = [f"{number} {status}" for status, number in result.statuses.most_common()]
    known = f"{result.known} were in the store" if result.known else ""
    print(f"{count_text(result.logs, 'log')}: {', '.join([*told_of, *([known] if known else [])])}")
    if result.verdicts:
        print(f"tolerances: {', '.join(f'{number} {verdict}' for verdict, number in result.verdicts.most_common())}")
    for log, status, reason in result.failures[:MOST_LISTED_FAILURES]:
        print(f"  {log}: {status}: {reason.removeprefix(f'{log}: ')}")
    if len(result.failures) > MOST_LISTED_FAILURES:
        print(f"  and {len(result.failures) - MOST_LISTED_FAILURES} more without a result, see the column reason")
    print(f"store: {out}")


def _seconds(text: str | None) -> float | None:
    if text is None:
        return None
    try:
        seconds = parse_time(text)
    except UnitError as error:
        raise UserError(f"--time-limit: {error}") from error
    if not seconds > 0.0:
        raise UserError(f'--time-limit: should be greater than 0, "60 s"; found {text!r}')
    return seconds


def _bytes(text: str | None) -> int | None:
    if text is None:
        return None
    for unit, factor in BYTE_UNITS.items():
        number = text.strip().removesuffix(unit).strip()
        if number != text.strip() and number.replace(".", "", 1).isdecimal() and float(number) > 0.0:
            return int(float(number) * factor)
    raise UserError(f'--memory-limit: expected a number and one of {", ".join(BYTE_UNITS)}, "2 GB"; found {text!r}')


@contextmanager
def _shown(quiet: bool) -> Iterator[Callable[[Standing], None]]:
    """A bar on a terminal, a line now and then elsewhere, nothing if `quiet`; all of it on stderr."""
    if quiet:
        yield lambda standing: None
    elif sys.stderr.isatty():
        yield from _bar()
    else:
        yield _Lines()


def _bar() -> Iterator[Callable[[Standing], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn("logs"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=Console(stderr=True)) as display:
        task = display.add_task("", total=None)

        def show(standing: Standing) -> None:
            display.update(task, total=standing.of, completed=standing.done, description=_rest(standing))

        yield show


class _Lines:
    """How far it is, every few seconds and at the end."""

    def __init__(self) -> None:
        self._last = -LINE_EVERY

    def __call__(self, standing: Standing) -> None:
        from time import monotonic

        if not standing.of:
            return
        if standing.done == standing.of or monotonic() - self._last >= LINE_EVERY:
            # in one piece, as a stage's name is (see progress)
            print(f"{standing.done} of {standing.of} logs{_rest(standing)}\n", end="", file=sys.stderr, flush=True)
            self._last = monotonic()


def _rest(standing: Standing) -> str:
    failed = f", {standing.failed} without a result" if standing.failed else ""
    left = (
        "" if standing.left is None or standing.done == standing.of else f", about {seconds_text(standing.left)} left"
    )
    return failed + left
