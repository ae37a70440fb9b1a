"""explore3d figures: the paper's own figures, drawn anew."""

from __future__ import annotations

from typing import Annotated

import typer

from explore3d import FolderError
from explore3d.cli.options import Out


def figures(
    out: Out,
    seeds: Annotated[
        int, typer.Option(min=1, help="Seeds of the noise in the table of the paper's section 4.2.2.")
    ] = 20,
) -> None:
    """Draw the paper's figures 1, 2, 3, 5, 7 and 8, and tabulate its four algorithms on the simulated apparatus.

    Example: explore3d figures --out out/figures
    """
    from explore3d.bench import write_apparatus, write_figures

    try:
        written = write_figures(out)
        more, table = write_apparatus(out, seeds)
    except OSError as error:
        raise FolderError(f"{out}: cannot write the figures: {error.strerror or error}") from error
    print("\n".join([*map(str, written), *map(str, more), "", table]), end="")
