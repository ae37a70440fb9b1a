"""explore3d figures, stability: the paper's own figures, and digits kept at the extremes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from explore3d import FolderError, UserError
from explore3d.cli.options import Json, Out
from mapping.geometry.mesh import write_whole

if TYPE_CHECKING:
    from explore3d.stability import Row


def figures(
    out: Out,
    seeds: Annotated[
        int, typer.Option(min=1, help="Seeds of the noise in the table of the paper's section 4.2.2.")
    ] = 20,
    json: Json = False,
) -> None:
    """Draw the paper's figures 1, 2, 3, 5, 7 and 8, and tabulate its four algorithms on the simulated apparatus.

    Example: explore3d figures --out out/figures
    """
    from dataclasses import asdict
    from json import dumps

    from explore3d.bench import findings_table, write_apparatus, write_figures

    try:
        written = write_figures(out)
        more, found = write_apparatus(out, seeds)
    except OSError as error:
        raise FolderError(f"{out}: cannot write the figures: {error.strerror or error}") from error
    files = [*map(str, written), *map(str, more)]
    if json:
        print(dumps({"written": files, "findings": [asdict(each) for each in found]}))
        return
    print("\n".join([*files, "", findings_table(found)]), end="")


def stability(
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for stability.html and stability.csv; none without it.")
    ] = None,
    only: Annotated[str | None, typer.Option(help="Run the cases whose group or name holds this text.")] = None,
    json: Json = False,
) -> None:
    """Ask questions of known answer at the extremes, and count the digits kept; ends with 1 if a case fails.

    Example: explore3d stability --out out/stability
    """
    from json import dumps

    from explore3d.stability import as_csv, cases, stability as run, stability_page, summary

    names = [name for name in cases() if only is None or only.lower() in name.lower()]
    if not names:
        raise UserError(f"--only: no case is called {only!r}; groups are {', '.join(sorted(_groups()))}")
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)  # what cannot be written is said before minutes are spent
    rows: list[Row] = []
    for row in run(names):
        rows.append(row)
        if not json:
            print(_line(row), flush=True)
    if out is not None:
        write_whole(out / "stability.csv", as_csv(rows))
        write_whole(out / "stability.html", stability_page(rows))
        if not json:
            print(f"page: {out / 'stability.html'}")
    record = {"cases": [row.record() for row in rows], "summary": summary(rows)}
    print(dumps(record, ensure_ascii=False, allow_nan=False) if json else summary(rows))
    if not all(row.passed for row in rows):
        raise typer.Exit(1)


def _line(row: Row) -> str:
    from explore3d.stability import cells

    group, name, _, found, kept, allowed, _, printed, _, seconds, verdict = cells(row)
    figures = f"{kept:>5} of {allowed:>5} digits" if kept else " " * 21
    more = f", printed form {printed}" if printed else ""
    return f"{verdict:6}{group + ': ' + name:46.46}{figures}{seconds:>7} s  {found[:90]}{more}"


def _groups() -> set[str]:
    from explore3d.stability import cases

    return {case.group for case in cases().values()}
