"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from explore3d import UnitError, UserError, parse_length


def length(option: str, text: str, *, positive: bool = False) -> float:
    """Metres from an option's text.

    Raises:
        UserError: one line that names the option.
    """
    try:
        value = parse_length(text)
    except UnitError as error:
        raise UserError(f"{option}: {error}") from error
    if value < 0.0 or (positive and value == 0.0):
        raise UserError(f"{option}: should be {'greater than' if positive else 'at least'} 0; found {text!r}")
    return value


def point(option: str, text: str) -> tuple[float, float, float]:
    """Three coordinates in metres from an option's text, "0 mm, 0 mm, 5 mm".

    Raises:
        UserError: one line that names the option.
    """
    try:
        parts = [parse_length(part.strip()) for part in text.split(",")]
    except UnitError as error:
        raise UserError(f"{option}: {error}") from error
    if len(parts) != 3:
        raise UserError(f'{option}: expected three lengths, "0 mm, 0 mm, 5 mm"; found {text!r}')
    return parts[0], parts[1], parts[2]


# Exit status of a job that moved and ended early: its results are of a part
INCOMPLETE = 3

Out = Annotated[Path, typer.Option("--out", "-o", help="Folder for the results; made if it is not there.")]
Overwrite = Annotated[
    bool,
    typer.Option(
        "--overwrite", help="Replace a session of something else in that folder, as soon as the new one is complete."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout, and no progress.")]
Force = Annotated[
    list[str] | None,
    typer.Option(
        "--force",
        metavar="STAGE",
        help="Run a stage that the report says was left out; may be repeated.",
    ),
]
FilesFrom = Annotated[
    list[Path] | None,
    typer.Option(
        "--files-from",
        metavar="DIR",
        help="A folder that the scene may name files in, beside its own and those next to that; may be repeated.",
    ),
]
NoReport = Annotated[bool, typer.Option("--no-report", help="Write no report and no pictures: tables and model alone.")]
Tolerances = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="TOML file of [[tolerance]] tables: what the drawing allows (docs/scene.md)."),
]
Pixel = Annotated[
    str | None,
    typer.Option(help='The file is a map of heights whose pixels are so far apart: "1 um", or "1 um, 2 um".'),
]
Average = Annotated[
    int | None,
    typer.Option(min=1, metavar="N", help="Make one sample, their mean, of N consecutive ones: for long recordings."),
]
Part = Annotated[
    str | None, typer.Option(help="Which one of several that a file holds: topic of a bag, sheet, channel, layer.")
]
TipRadius = Annotated[
    str | None, typer.Option(help='Radius of the fingertip, "2 um"; logs of ours state it, tables do not.')
]
Units = Annotated[str | None, typer.Option(help="Unit of a table's coordinates, for example mm.")]
Columns = Annotated[
    str | None, typer.Option(help='Which column of a table is what: "x=X, z=Y", or by number "x=1, z=2".')
]
Frame = Annotated[
    str | None, typer.Option(metavar="X,Y,Z", help='Origin of a table in the object frame: "0 mm, 0 mm, 5 mm".')
]
SameObject = Annotated[
    bool, typer.Option("--same-object", help="Several recordings are sweeps over one object, in one frame.")
]
