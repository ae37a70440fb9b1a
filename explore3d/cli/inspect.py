"""explore3d inspect: what a file holds, how it is understood, and what it leaves open."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from explore3d.cli.options import Average, Columns, Json, Part, Pixel, TipRadius, Units


def inspect(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A log, a session folder, a table, a point list.")],
    tip_radius: TipRadius = None,
    units: Units = None,
    columns: Columns = None,
    pixel: Pixel = None,
    part: Part = None,
    average: Average = None,
    json: Json = False,
) -> None:
    """Say what a file is: columns, units, sweeps, extent, spacing, gaps, what is doubtful and how to settle it.

    Example: explore3d inspect scan.csv
    """
    from dataclasses import asdict
    from json import dumps

    from explore3d.log import inspect as look

    found = look(file, tip_radius=tip_radius, units=units, columns=columns, pixel=pixel, part=part, average=average)
    print(dumps(asdict(found), ensure_ascii=False, allow_nan=False) if json else "\n".join(found.lines()))
