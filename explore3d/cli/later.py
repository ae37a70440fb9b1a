"""explore3d merge, compare: what later logs of one object add to its model, and what has changed since."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from explore3d import UserError, count_text, parse_time
from explore3d.cli.options import Average, Columns, Frame, Json, Out, Overwrite, Part, Pixel, TipRadius, Units, length

if TYPE_CHECKING:
    from explore3d.jobs import Compared

# Changes that are listed one by one; the JSON has them all
MOST_LISTED_CHANGES = 30
MEASURES = {"grown": "by", "shrunk": "by", "moved": "by", "new": "height", "gone": "height"}


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
    frame: Frame = None,
    average: Average = None,
    json: Json = False,
    overwrite: Overwrite = False,
) -> None:
    """Update a model's features by later logs instead of finding them anew; none is removed.

    A log whose mesh or samples lie off the model's base is refused: it shows another object, or another frame.

    Example: explore3d merge out/wire out/second/log.mcap --out out/both
    """
    from json import dumps

    from explore3d.cli.progress import shown
    from explore3d.jobs import merge as join
    from explore3d.report import feature_line

    with shown(quiet=json) as progress:
        merged = join(
            model,
            logs,
            out,
            length("--pose-sd", pose_sd),
            overwrite,
            progress=progress,
            tip_radius=tip_radius,
            units=units,
            columns=columns,
            pixel=pixel,
            part=part,
            frame=None if frame is None else {"origin": [each.strip() for each in frame.split(",")]},
            average=average,
        )
    if json:
        print(dumps(merged.document(), ensure_ascii=False, allow_nan=False))
        return
    results = [f"{name}: {out / file}" for name, file in (("model", "model.json"), ("features", "features.csv"))]
    print("\n".join([*map(feature_line, merged.features), *results]))


def compare(
    first: Annotated[Path, typer.Argument(metavar="A", help="Model (folder or model.json) or log of the first scan.")],
    second: Annotated[
        Path, typer.Argument(metavar="B", help="The same of the second; with --watch a folder that logs come into.")
    ],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for comparison.json and the map of deviations.")
    ] = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Compare each log that comes into the folder B with A.")
    ] = False,
    idle: Annotated[str | None, typer.Option(help='End watching after so long without a new log, "60 s".')] = None,
    shift: Annotated[
        str | None, typer.Option(help='Largest shift between the frames, "1 mm"; a tenth of the object.')
    ] = None,
    probability: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Changes at least so probable are listed.")
    ] = 0.95,
    tip_radius: TipRadius = None,
    form: Annotated[str | None, typer.Option(help="Shape of a fitted base, as for analyze.")] = None,
    units: Units = None,
    columns: Columns = None,
    pixel: Pixel = None,
    part: Part = None,
    json: Json = False,
    overwrite: Overwrite = False,
) -> None:
    """Register two scans of one object and tell what is new, gone, grown, shrunk or moved, each with its probability.

    Example: explore3d compare out/before out/after --out out/wear
    """
    from json import dumps

    from explore3d.cli.progress import shown
    from explore3d.jobs import Told, compare as compare_scans, watched

    most = None if shift is None else length("--shift", shift, positive=True)
    table = {"form": form, "units": units, "columns": columns, "pixel": pixel, "part": part}
    told = Told(tip_radius, quick=True, table={name: value for name, value in table.items() if value is not None})
    if watch and not second.is_dir():
        raise UserError(f"{second}: --watch needs a folder that logs come into")
    if watch and out is not None:
        raise UserError("--watch writes nothing: leave --out out, and take --json for a line of JSON for each log")
    settings: dict[str, Any] = {"told": told, "most_shift": most}
    if not watch:
        with shown(quiet=json) as progress:
            found = compare_scans(first, second, out, overwrite=overwrite, progress=progress, **settings)
        print(dumps(found.record()) if json else "\n".join(_lines(found, probability)))
        if out is not None and not json:
            print(f"comparison: {out / 'comparison.json'}")
        return
    for path in watched(second, idle=None if idle is None else parse_time(idle)):
        try:
            found = compare_scans(first, path, **settings)
        except UserError as error:  # one bad log must not end the watch
            print(dumps({"second": str(path), "refused": str(error)}) if json else f"{path.name}: {error}", flush=True)
            continue
        told_of = _lines(found, probability)
        print(dumps(found.record()) if json else "\n".join([f"{path.name}: {told_of[0]}", *told_of[1:]]), flush=True)


def _lines(found: Compared, least: float) -> list[str]:
    from mapping import Interval, length_text

    comparison = found.comparison
    motion, likely = comparison.registration, comparison.likely(least)
    shift = length_text(float((motion.shift**2).sum() ** 0.5))
    turn = f", turned by {motion.angle:.2g} rad" if motion.angle > 0.0 else ""
    by = count_text(motion.pairs, "feature")
    how = f"registered by {by} (shifted by {shift}{turn})" if motion.pairs else "frames taken as they are"
    pairs = count_text(comparison.pairs, "feature is", "features are")
    changes = count_text(len(likely), "change")
    if not likely and 0 < len(found.model.features) == len(comparison.unseen):
        changes = "nothing of the first is known to have stayed or changed"
    lines = [f"{changes}; {pairs} in both; {how}"]
    for change in likely[:MOST_LISTED_CHANGES]:
        amount = change.amount
        if change.kind == "shrunk":
            amount = Interval(-amount.median, -amount.high, -amount.low)
        name = change.first or change.second
        if change.first and change.second:
            name += f" ({change.second} of the second scan)"
        lines.append(f"  {change.kind}: {name}, {MEASURES[change.kind]} {amount}, probability {change.probability:.3f}")
    if len(likely) > MOST_LISTED_CHANGES:
        lines.append(f"  and {len(likely) - MOST_LISTED_CHANGES} more, see --json")
    if comparison.unseen:
        lines.append(f"  the second scan did not look at {', '.join(comparison.unseen)}")
    return lines
