"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

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
Pixel = Annotated[
    str | None,
    typer.Option(help='The file is a map of heights whose pixels are so far apart: "1 um", or "1 um, 2 um".'),
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
