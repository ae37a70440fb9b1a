"""explore3d analyze: the annotated model of what was recorded."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from explore3d.cli.options import Force, Json, Out, Overwrite, Part, Pixel


def analyze(
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOG...", help="Logs, session folders, tables, points, maps (docs/log.md).")
    ],
    out: Out,
    tip_radius: Annotated[
        str | None, typer.Option(help='Radius of the fingertip, "2 um"; logs of ours state it, tables do not.')
    ] = None,
    units: Annotated[str | None, typer.Option(help="Unit of a table's coordinates, for example mm.")] = None,
    columns: Annotated[
        str | None, typer.Option(help='Which column of a table is what: "x=X, z=Y", or by number "x=1, z=2".')
    ] = None,
    pixel: Pixel = None,
    part: Part = None,
    frame: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help='Origin of a table in the object frame: "0 mm, 0 mm, 5 mm".')
    ] = None,
    model: Annotated[
        Path | None, typer.Option(help="Mesh of the global model; else the log's own, else one is fitted.")
    ] = None,
    model_units: Annotated[str, typer.Option(help="Unit of that mesh's coordinates.")] = "m",
    force: Force = None,
    json: Json = False,
    overwrite: Overwrite = False,
) -> None:
    """Build the annotated model and the report from recordings alone.

    Example: explore3d analyze scan.csv --tip-radius "2 um" --units mm --out out/scan
    """
    from explore3d.cli.progress import shown
    from explore3d.jobs import analyze as build
    from explore3d.report import show

    origin = None if frame is None else {"origin": [part.strip() for part in frame.split(",")]}
    with shown(quiet=json) as progress:
        analysis = build(
            logs,
            out,
            tip_radius=tip_radius,
            model=model,
            model_units=model_units,
            progress=progress,
            force=force or (),
            overwrite=overwrite,
            units=units,
            columns=columns,
            pixel=pixel,
            part=part,
            frame=origin,
        )
    show(analysis, out, json)
