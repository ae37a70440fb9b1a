"""explore3d analyze: the annotated model of what was recorded."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from explore3d import UserError
from explore3d.cli.options import (
    INCOMPLETE,
    Average,
    Columns,
    Force,
    Frame,
    Json,
    NoReport,
    Out,
    Overwrite,
    Part,
    Pixel,
    SameObject,
    TipRadius,
    Tolerances,
    Units,
    length,
)


def analyze(
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOG...", help="Logs, session folders, tables, points, maps (docs/log.md).")
    ],
    out: Out,
    tip_radius: TipRadius = None,
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
    in_contact: Annotated[
        bool,
        typer.Option("--in-contact", help="The finger touched at every sample of a table: look for no lifted finger."),
    ] = False,
    tolerances: Tolerances = None,
    units: Units = None,
    columns: Columns = None,
    pixel: Pixel = None,
    part: Part = None,
    average: Average = None,
    frame: Frame = None,
    same_object: SameObject = False,
    model: Annotated[
        Path | None, typer.Option(help="Mesh of the global model; else the log's own, else one is fitted.")
    ] = None,
    model_units: Annotated[str, typer.Option(help="Unit of that mesh's coordinates.")] = "m",
    force: Force = None,
    json: Json = False,
    overwrite: Overwrite = False,
    no_report: NoReport = False,
    quick: Annotated[
        bool, typer.Option("--quick", help="Only existence, places and sizes: no report, no chains, no surface.")
    ] = False,
) -> None:
    """Build the annotated model and the report from recordings alone.

    Example: explore3d analyze scan.csv --tip-radius "2 um" --units mm --out out/scan
    """
    from explore3d.cli.progress import shown
    from explore3d.jobs import analyze_each
    from explore3d.report import show

    origin = None if frame is None else {"origin": [part.strip() for part in frame.split(",")]}
    told: list[str] = []
    with shown(quiet=json) as progress:
        analyses = analyze_each(
            logs,
            out,
            same_object=same_object,
            tell=told.append,
            tip_radius=tip_radius,
            tip_sd=tip_sd,
            form=form,
            mask=mask,
            in_contact=in_contact or None,
            tolerances=tolerances,
            model=model,
            model_units=model_units,
            progress=progress,
            force=force or (),
            overwrite=overwrite,
            report=not no_report,
            quick=quick,
            units=units,
            columns=columns,
            pixel=pixel,
            part=part,
            average=average,
            frame=origin,
        )
    if told and not json:
        print(told[0])
    for analysis in analyses:
        show(analysis, out, json)
    if any(analysis.refused for analysis in analyses):
        raise typer.Exit(INCOMPLETE)


def roughness(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="Log, table, map (docs/log.md).")],
    cutoff: Annotated[
        str | None, typer.Option(help='Nesting index of the L-filter, "0.8 mm"; else the largest that fits 5 times.')
    ] = None,
    short_cutoff: Annotated[
        str | None, typer.Option(help='Nesting index of the S-filter, "2.5 um"; else what belongs to the other.')
    ] = None,
    tip_radius: TipRadius = None,
    form: Annotated[str | None, typer.Option(help="Form that is removed first, as for analyze.")] = None,
    units: Units = None,
    columns: Columns = None,
    pixel: Pixel = None,
    part: Part = None,
    json: Json = False,
) -> None:
    """Roughness and waviness beside the features, by ISO 21920-2 and ISO 25178-2, each with its interval.

    Example: explore3d roughness scan.csv --tip-radius "2 um" --units mm --cutoff "0.8 mm"
    """
    from json import dumps

    from explore3d.cli.progress import shown
    from explore3d.jobs import analyze as carry_out
    from mapping.model import plain

    with shown(quiet=json) as progress:
        analysis = carry_out(
            log,
            tip_radius=tip_radius,
            form=form,
            units=units,
            columns=columns,
            pixel=pixel,
            part=part,
            quick=True,
            force=("roughness", "standard heights"),
            progress=progress,
            cutoffs=(
                None if cutoff is None else length("--cutoff", cutoff, positive=True),
                None if short_cutoff is None else length("--short-cutoff", short_cutoff, positive=True),
            ),
        )
    found = analysis.roughness
    if found is None:
        raise UserError(
            f"{log}: too short, or too full of features, for one section of the filter; a shorter --cutoff may do"
        )
    heights = analysis.standard_heights
    if json:
        record = found.record() | {"standard_heights": [each.record() for each in heights]}
        print(dumps(plain(record), ensure_ascii=False, allow_nan=False))
        return
    print("\n".join(f"  {name:<4} {value:<12} {span}".rstrip() for name, value, span in found.rows()))
    print(found.sentence())
    for name, method, height, wolf in (each.row() for each in heights):
        print(f"  {name} by {method}: {height}" + (f"; Wolf pruning height {wolf}" if wolf else ""))
