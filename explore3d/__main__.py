"""`python -m explore3d` is the command `explore3d`."""

import ctypes
import gc
import signal
import sys

from hw import SIGNALS, end_program

# Objects made since the last look for cycles, after which there is a new one: a run makes millions that live as long as
# it, by imports alone, and looking at them after every 700 was 3 % of it
COLLECT_AFTER = 50_000
# glibc's number for the setting (malloc.h), and the size of arrays from which on they have pages of their own: twice a
# share of draws (threads.MOST_VALUES), of which a posterior makes thousands. Once it is set, free memory goes back to
# the system as well, which glibc leaves off when large arrays come and go: the paper's wire took 620 MB, not 530
M_MMAP_THRESHOLD, OWN_PAGES = -3, 2**24
# And how much may stay free before it goes back: by default 128 kB, so that every array of a few hundred kB has its
# pages made and cleared anew: on the paper's wire 650,000 of them, in 1.3 CPU s; with 4 MB 220,000, in 0.7
M_TRIM_THRESHOLD, KEPT_FREE = -1, 2**22
# And in how many places memory is taken from: one for each thread by default, each with holes of its own
M_ARENA_MAX, PLACES = -8, 1


def main() -> None:
    """The command line, as a process of its own.

    A signal ends it with one line while it is still being loaded, too. Once all is said and written, signals do
    nothing: what tidies up behind a finished program has nothing to lose, and its exit status stands.
    """
    gc.set_threshold(COLLECT_AFTER)
    _give_memory_back()
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


def _give_memory_back() -> None:
    """Have arrays leave no holes behind where the system's allocator is glibc's; another one does as it does."""
    setting = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if setting is not None:
        setting(M_MMAP_THRESHOLD, OWN_PAGES)
        setting(M_TRIM_THRESHOLD, KEPT_FREE)
        setting(M_ARENA_MAX, PLACES)


def _end_before_the_beginning(cause: str, status: int) -> None:
    print(f"explore3d: interrupted ({cause}) before anything began", file=sys.stderr)
    sys.exit(status)


if __name__ == "__main__":
    main()
