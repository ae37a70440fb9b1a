"""The command line: each command is a thin function round one call of the library."""

from __future__ import annotations

import os
import signal
import sys
from typing import Annotated

import typer

from explore3d import UserError, __version__
from explore3d.cli.analyze import analyze, roughness
from explore3d.cli.batch import batch
from explore3d.cli.begin import examples, init
from explore3d.cli.bench import bench
from explore3d.cli.display import display, vibrate, watch
from explore3d.cli.doctor import doctor
from explore3d.cli.figures import figures, stability
from explore3d.cli.hardware import calibrate, emulate, reprobe, selftest
from explore3d.cli.inspect import export, inspect
from explore3d.cli.interrupted import DISK_ERRORS, InterruptedJobError, is_kept, one_line, told
from explore3d.cli.later import compare, merge
from explore3d.cli.options import INCOMPLETE
from explore3d.cli.run import plan, run
from hw import SIGNALS, FingerError, MoveError, end_program
from mapping import MappingError
from planners import PlannerError

PROGRAM_HELP = "Find, follow and measure surface features that are finer than the fingertip that touches them."

MODEL = (
    init,
    examples,
    plan,
    run,
    analyze,
    roughness,
    batch,
    compare,
    inspect,
    export,
    merge,
    watch,
    display,
    vibrate,
    figures,
)
MACHINE = (doctor, emulate, calibrate, selftest, reprobe, stability)


def command_line(asked: str = "") -> typer.Typer:
    """The commands; the one that is asked for alone, if there is one of that name.

    typer reads the signature of every command that it is given, 0.1 CPU s for all: a tenth of a quick analysis.
    """
    app = typer.Typer(
        name="explore3d",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    commands = {command.__name__: command for command in (*MODEL, *MACHINE)}
    for command in [commands[asked]] if asked in commands else commands.values():
        app.command()(one_line(command))
    if asked not in commands:
        app.add_typer(bench, name="bench")
    app.callback(help=PROGRAM_HELP)(_common)
    return app


def _show_version(asked: bool) -> None:
    if asked:
        print(f"explore3d {__version__}")
        raise typer.Exit


def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None: ...


def main() -> None:
    """Entry point: what the user can mend ends with one line on stderr, never with a traceback.

    Exit status: 0 done; 2 refused or not possible, nothing was recorded; 3 ended early, what was recorded is kept;
    130 and 143 (128 and the signal's number) by Ctrl-C and SIGTERM, and what was recorded is kept, too.
    """
    for number in SIGNALS:
        signal.signal(number, end_program)
    # Our matrices are small: more threads of linear algebra only wait for each other, for minutes on a busy machine.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        command_line(sys.argv[1] if len(sys.argv) > 1 else "")()
    except InterruptedJobError as error:
        print(f"explore3d: {error}", file=sys.stderr)
        sys.exit(error.status)
    except (UserError, MappingError, PlannerError, MoveError, FingerError, OSError) as error:
        if isinstance(error, OSError) and error.errno not in DISK_ERRORS:
            raise
        print(f"explore3d: {told(error)}", file=sys.stderr)
        sys.exit(INCOMPLETE if is_kept(error) else 2)
    except KeyboardInterrupt:
        print("explore3d: interrupted (Ctrl-C)", file=sys.stderr)
        sys.exit(130)
    except SystemExit as end:
        # by a signal before or after the command itself: typer passes such an end on without a word
        if isinstance(end.code, int) and end.code > 128:
            print(f"explore3d: interrupted ({signal.Signals(end.code - 128).name})", file=sys.stderr)
        raise


if __name__ == "__main__":
    main()
