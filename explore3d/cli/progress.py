"""How a terminal shows the progress of a long job: on stderr, so that stdout stays clean for results."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from explore3d import seconds_text
from explore3d.analysis import Progress, silent


@contextmanager
def shown(quiet: bool = False) -> Iterator[Progress]:
    """Bars on a terminal, one line a stage elsewhere, nothing if `quiet`."""
    if quiet:
        yield silent
    elif sys.stderr.isatty():
        yield from _bars()
    else:
        yield _Lines()


def _bars() -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskID, TextColumn, TimeElapsedColumn
    from rich.text import Text

    class TimeLeft(ProgressColumn):
        """What a stage will still take at its speed of late; nothing until that is known."""

        def render(self, task: Task) -> Text:
            left = None if task.finished else task.time_remaining
            return Text("" if not left else f"{seconds_text(left)} left", style="progress.remaining")

    columns = (TextColumn("{task.description:<24}"), BarColumn(), TimeElapsedColumn(), TimeLeft())
    tasks: dict[str, TaskID] = {}
    with Progress(*columns, console=Console(stderr=True)) as display:

        def show(stage: str, share: float) -> None:
            if stage not in tasks:
                tasks[stage] = display.add_task(stage, total=1.0)
            display.update(tasks[stage], completed=share)

        yield show


class _Lines:
    """Names each stage once, on stderr: enough for a log file."""

    def __init__(self) -> None:
        self._stage = ""

    def __call__(self, stage: str, share: float) -> None:
        if stage != self._stage:
            # in one piece: a signal between a word and the end of its line would glue what is said of it to the word
            print(f"{stage}\n", end="", file=sys.stderr, flush=True)
            self._stage = stage
