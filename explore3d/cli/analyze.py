"""explore3d analyze: the annotated model of what was recorded."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from explore3d.cli.options import Force, Json, Out, Overwrite


def analyze(
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOG...", help="MCAP logs, session folders, CSV or TXT tables.")
    ],
    out: Out,
    tip_radius: Annotated[
        str | None, typer.Option(help='Radius of the fingertip, "2 um"; logs of ours state it, tables do not.')
    ] = None,
    tip_sd: Annotated[
        str | None,
        typer.Option(
            help='Standard deviation of that radius, "20 nm"; 1 % of it is assumed for tables, "0 m" is exact.'
        ),
    ] = None,
    form: Annotated[
        str | None,
        typer.Option(
            metavar="FORM",
            help="Shape of a fitted base: auto, line, arc, poly:N, gaussian:WAVELENGTH (gaussian:0.8mm), none.",
        ),
    ] = None,
    mask: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FROM..TO", help="Stretch in x that the base is not fitted to (1.2mm..1.4mm); may be repeated."
        ),
    ] = None,
    units: Annotated[str | None, typer.Option(help="Unit of a table's coordinates, for example mm.")] = None,
    columns: Annotated[
        str | None, typer.Option(help='Which column of a table is what: "x=X, z=Y", or by number "x=1, z=2".')
    ] = None,
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
            tip_sd=tip_sd,
            form=form,
            mask=mask,
            model=model,
            model_units=model_units,
            progress=progress,
            force=force or (),
            overwrite=overwrite,
            units=units,
            columns=columns,
            frame=origin,
        )
    show(analysis, out, json)
