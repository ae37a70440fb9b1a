"""The command line: each command is a thin function round one call of the library."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from explore3d import __version__
from explore3d.errors import UserError

app = typer.Typer(
    name="explore3d",
    help="Find, follow and measure surface features that are finer than the fingertip that touches them.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Out = Annotated[Path, typer.Option("--out", "-o", help="Folder to write; made if it does not exist.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]


def _show_version(asked: bool) -> None:
    if asked:
        print(f"explore3d {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """Find, follow and measure surface features that are finer than the fingertip that touches them."""


def main() -> None:
    """Entry point: bad input ends with one line on stderr and status 2."""
    from hw.errors import FingerError, MoveError
    from mapping.errors import MappingError

    try:
        app()
    except (UserError, MappingError, MoveError, FingerError) as error:
        print(f"explore3d: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("explore3d: interrupted", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
