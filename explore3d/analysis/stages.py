"""Stages: which parts of a job ran, how long each took, which were left out and why."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from explore3d import UserError
from explore3d.analysis.memory import give_memory_back
from mapping import LeftOut

# The stage in which a finger moves
FINGER_STAGE = "exploration"
# Stages that a job may leave out, and that can be forced back in
OPTIONAL_STAGES = (
    "dynamics",
    "base fit",
    "pose",
    "yielding",
    "deviation",
    "algorithms 1 and 2",
    "injected crests",
    "grammar",
    "faint lines",
    "posterior",
    "long chain",
    "estimated surface",
    "roughness",
    "standard heights",
    "smoothing",
    "curvature",
    "error against time",
    "rendered pictures",
)
# Told the stage's name and the share of it that is done, 0 to 1.
Progress = Callable[[str, float], None]


def silent(stage: str, share: float) -> None:
    """Progress that nobody watches."""


@dataclass
class Stages:
    """The account of one job.

    Args:
        progress: told what is under way.
        forced: names of stages, of OPTIONAL_STAGES, to run even where the scene does not need them.
        cutoffs: nesting indices of the L-filter and of the S-filter for roughness, m; None: by the standard.
        quick: only what existence, places and sizes need; the rest is left out unless it is forced.

    Raises:
        UserError: a stage to be forced that there is not.
    """

    progress: Progress = silent
    forced: Collection[str] = ()
    quick: bool = False
    cutoffs: tuple[float | None, float | None] = (None, None)
    timings: dict[str, float] = field(default_factory=dict)
    left_out: list[LeftOut] = field(default_factory=list)

    def __post_init__(self) -> None:
        for name in self.forced:
            if name not in OPTIONAL_STAGES:
                raise UserError(f"no stage {name!r} to force; possible: {', '.join(OPTIONAL_STAGES)}")

    @contextmanager
    def stage(self, name: str) -> Iterator[Callable[[float], None]]:
        """Time a stage; yields a function that reports the share done."""
        self.progress(name, 0.0)
        start = time.perf_counter()
        try:
            yield lambda share: self.progress(name, share)
        finally:
            self.timings[name] = self.timings.get(name, 0.0) + time.perf_counter() - start
        give_memory_back()
        self.progress(name, 1.0)

    def is_forced(self, name: str) -> bool:
        """True if the stage is to run even where it is not needed."""
        return name in self.forced

    def needed(self, name: str, why_not: str, saved: str = "", possible: bool = True) -> bool:
        """True if the stage is to run: `why_not` is empty or the stage is forced; else noted as left out.

        A stage that is not `possible` for want of what it works on stays left out even if forced.
        """
        if not why_not or (possible and self.is_forced(name)):
            return True
        self.left_out.append(LeftOut(name, why_not, saved))
        return False
