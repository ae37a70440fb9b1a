"""The command line: each command is a thin function round one call of the library."""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from explore3d import UserError, __version__
from explore3d.cli.analyze import analyze
from explore3d.cli.bench import bench
from explore3d.cli.doctor import doctor
from explore3d.cli.figures import figures
from explore3d.cli.hardware import calibrate, emulate, reprobe, selftest
from explore3d.cli.inspect import inspect
from explore3d.cli.merge import merge
from explore3d.cli.run import plan, run
from explore3d.cli.stability import stability
from hw import FingerError, MoveError
from mapping import MappingError
from planners import PlannerError

PROGRAM_HELP = "Find, follow and measure surface features that are finer than the fingertip that touches them."

app = typer.Typer(
    name="explore3d",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (run, plan, analyze, inspect, merge, figures, doctor, emulate, calibrate, selftest, reprobe, stability):
    app.command()(command)
app.add_typer(bench, name="bench")


def _show_version(asked: bool) -> None:
    if asked:
        print(f"explore3d {__version__}")
        raise typer.Exit


@app.callback(help=PROGRAM_HELP)
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None: ...


def main() -> None:
    """Entry point: what the user can mend ends with one line on stderr and status 2, never with a traceback."""

    # Our matrices are small: more threads of linear algebra only wait for each other, for minutes on a busy machine.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        app()
    except (UserError, MappingError, PlannerError, MoveError, FingerError) as error:
        print(f"explore3d: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("explore3d: interrupted", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
