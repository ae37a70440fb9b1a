"""explore3d stability: digits kept at the extremes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from explore3d import UserError
from mapping.geometry.mesh import write_whole

if TYPE_CHECKING:
    from explore3d.stability import Row


def stability(
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for stability.html and stability.csv; none without it.")
    ] = None,
    only: Annotated[str | None, typer.Option(help="Run the cases whose group or name holds this text.")] = None,
) -> None:
    """Ask questions of known answer at the extremes, and count the digits kept; ends with 1 if a case fails.

    Example: explore3d stability --out out/stability
    """
    from explore3d.stability import as_csv, cases, stability as run, stability_page, summary

    names = [name for name in cases() if only is None or only.lower() in name.lower()]
    if not names:
        raise UserError(f"--only: no case is called {only!r}; groups are {', '.join(sorted(_groups()))}")
    rows: list[Row] = []
    for row in run(names):
        rows.append(row)
        print(_line(row), flush=True)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        write_whole(out / "stability.csv", as_csv(rows))
        write_whole(out / "stability.html", stability_page(rows))
        print(f"page: {out / 'stability.html'}")
    print(summary(rows))
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
