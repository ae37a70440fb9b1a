"""explore3d merge: later logs of the same object join a model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from explore3d.cli.options import Average, Columns, Frame, Out, Overwrite, Part, Pixel, TipRadius, Units, length


def merge(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="Folder or model.json of the known model.")],
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Later recordings of it, as for analyze.")],
    out: Out,
    pose_sd: Annotated[str, typer.Option(help='Standard deviation of the pose between the logs, "0.1 mm".')] = "0 mm",
    tip_radius: TipRadius = None,
    units: Units = None,
    columns: Columns = None,
    pixel: Pixel = None,
    part: Part = None,
    average: Average = None,
    frame: Frame = None,
    overwrite: Overwrite = False,
) -> None:
    """Update a model's features by later logs instead of finding them anew; none is removed.

    A log whose mesh or samples lie off the model's base is refused: it shows another object, or another frame.

    Example: explore3d merge out/wire out/second/log.mcap --out out/both
    """
    from explore3d.jobs import merge as join
    from explore3d.report import feature_line

    merged = join(
        model,
        logs,
        out,
        length("--pose-sd", pose_sd),
        overwrite,
        tip_radius=tip_radius,
        units=units,
        columns=columns,
        pixel=pixel,
        part=part,
        average=average,
        frame=None if frame is None else {"origin": [each.strip() for each in frame.split(",")]},
    )
    print("\n".join([*map(feature_line, merged.features), f"model: {out / 'model.json'}"]))
