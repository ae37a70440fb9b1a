"""explore3d inspect, export: what a file holds, how it is understood; and what was found, in the forms of others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from explore3d.cli.options import Average, Columns, Json, Part, Pixel, TipRadius, Units


def inspect(
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="A log, a session folder, a table, a point list; or an address.")
    ],
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

    from explore3d.jobs.batch import inspect_at
    from explore3d.log import inspect as look

    settings: dict[str, Any] = {
        "tip_radius": tip_radius,
        "units": units,
        "columns": columns,
        "pixel": pixel,
        "part": part,
    }
    settings |= {"average": average}
    found = inspect_at(file, settings) if "://" in file else look(file, **settings)
    print(dumps(asdict(found), ensure_ascii=False, allow_nan=False) if json else "\n".join(found.lines()))


def export(
    source: Annotated[
        Path, typer.Argument(metavar="SOURCE", help="Model (folder or model.json); for X3P a log, or its session.")
    ],
    to: Annotated[
        list[Path],
        typer.Option("--to", help="NAME.csv, .dxf, .qif, .mcap, .x3p, or ro-crate-metadata.json; may be repeated."),
    ],
    tip_radius: TipRadius = None,
    units: Units = None,
    columns: Columns = None,
    pixel: Pixel = None,
    part: Part = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that is there; never a log.")] = False,
    json: Json = False,
) -> None:
    """Write crest lines (CSV, DXF), measured results (QIF), the log with the features drawn in it (MCAP), heights over
    the base beside the features (X3P), or a session's record (RO-Crate).

    Example: explore3d export out/wire --to crests.dxf --to crests.csv
    """
    from json import dumps

    from explore3d.jobs import Told
    from explore3d.jobs.export import export as write, may_be_written

    table = {"units": units, "columns": columns, "pixel": pixel, "part": part}
    told = Told(tip_radius, table={name: value for name, value in table.items() if value is not None})
    may_be_written(source, *to, overwrite=overwrite)  # all or none
    written = []
    for path in to:
        written.append(str(write(source, path, told, overwrite=overwrite)))
        if not json:
            print(f"written: {written[-1]}")
    if json:
        print(dumps({"written": written}, ensure_ascii=False))
