"""`python -m explore3d` is the command `explore3d`."""

import gc
import signal
import sys

from explore3d.analysis import leave_no_holes
from hw import SIGNALS, end_program

# Objects made since the last look for cycles, after which there is a new one: a run makes millions that live as long as
# it, by imports alone, and looking at them after every 700 was 3 % of it
COLLECT_AFTER = 50_000


def main() -> None:
    """The command line, as a process of its own.

    A signal ends it with one line while it is still being loaded, too. Once all is said and written, signals do
    nothing: what tidies up behind a finished program has nothing to lose, and its exit status stands.
    """
    gc.set_threshold(COLLECT_AFTER)
    leave_no_holes()
    for number in SIGNALS:
        signal.signal(number, end_program)
    try:
        try:
            from explore3d.cli import main as command
        except KeyboardInterrupt:
            _end_before_the_beginning("Ctrl-C", 128 + signal.SIGINT)
        except SystemExit as error:
            code = int(error.code or 0)
            _end_before_the_beginning(signal.Signals(code - 128).name if code > 128 else f"status {code}", code)
        command()
    finally:
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        # Python looks for cycles once more at its end, in all that there is: 0.3 of 3.0 s of a quick analysis
        gc.freeze()


def _end_before_the_beginning(cause: str, status: int) -> None:
    print(f"explore3d: interrupted ({cause}) before anything began", file=sys.stderr)
    sys.exit(status)


if __name__ == "__main__":
    main()
