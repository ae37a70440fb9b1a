"""explore3d figures: the paper's own figures, drawn anew."""

from __future__ import annotations

from explore3d.cli_options import Out


def figures(out: Out) -> None:
    """Draw the paper's figures 1, 2, 3 and 5 from the library's public functions.

    Example: explore3d figures --out out/figures
    """
    from explore3d.errors import FolderError
    from explore3d.figures import write_figures

    try:
        written = write_figures(out)
    except OSError as error:
        raise FolderError(f"{out}: cannot write the figures: {error.strerror or error}") from error
    print("\n".join(map(str, written)))
