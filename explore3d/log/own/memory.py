"""What recordings take of the memory, and refusals, before anything is computed, of those that it cannot hold."""

from __future__ import annotations

import math
from pathlib import Path

from explore3d import UserError

# Bytes of memory that a byte of a table takes while it becomes a trace: 3.7 measured, 3e6 rows of two columns in 51 MB
READING = 4.0
# Bytes that a sample takes while a model is built of it: 12e6 samples took about 4 GB
ANALYSING = 340.0
# What averaging leaves unless the memory is short: sweeps of a thousand samples, a thousand of them
USUAL_SAMPLES = 1e6
LINE_SAMPLE = 2**16  # bytes of a table that tell how long its lines are


def must_fit(path: Path) -> None:
    """Refuse a table that the memory which is free cannot hold.

    Raises:
        UserError: naming both, and how many rows to average.
    """
    try:
        size, free = path.stat().st_size, free_memory()
        if READING * size <= free:
            return
        with path.open("rb") as file:
            sample = file.read(LINE_SAMPLE)
    except OSError:
        return  # who reads it says why not
    rows = size * sample.count(b"\n") / max(len(sample), 1)
    raise UserError(
        f"{path}: to read its {size:,} bytes takes about {READING * size / 1e9:.1f} GB of memory; {free / 1e9:.1f} GB "
        f"are free; possible: --average {runs_that_fit(rows, free)}, which reads it in pieces and takes the mean of so "
        "many rows, or a part of its rows (explore3d inspect looks at it in pieces)"
    )


def must_fit_analysis(path: Path | str, samples: float, average: int = 1) -> None:
    """Refuse more samples than the memory which is free can be asked to make a model of.

    Args:
        samples: how many there are, each the mean of `average`.

    Raises:
        UserError: naming both, and how many samples to average.
    """
    free = free_memory()
    if ANALYSING * samples > free:
        raise UserError(
            f"{path}: the model of about {samples:,.0f} samples takes about {ANALYSING * samples / 1e9:.1f} GB of "
            f"memory; {free / 1e9:.1f} GB are free; possible: --average {runs_that_fit(samples * average, free)}, "
            "which takes the mean of so many consecutive samples"
        )


def runs_that_fit(rows: float, free: float) -> int:
    """How many rows to average, a round number, so that no more is left than is usual and half the memory takes."""
    least = max(rows / min(USUAL_SAMPLES, max(0.5 * free / ANALYSING, 1.0)), 2.0)
    ten = 10.0 ** math.floor(math.log10(least))
    return int(next(step * ten for step in (1.0, 2.0, 5.0, 10.0) if step * ten >= least))


def free_memory() -> float:
    """Bytes that a program may still take; infinite where the system does not say it."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        return float("inf")
    return next((1024.0 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:")), float("inf"))
