"""What leaving a stage out saved: measured where it can be, else estimated from what the others cost, and said so.

The ratios were measured at 3e6 samples of the paper's apparatus over four wires (`explore3d bench scaling`): what a
stage costs in units of that run's detection, which every analysis has done by itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from explore3d.quantity import seconds_text
from mapping.left_out import LeftOut

# Cost of a stage over that of detection
RATIOS = {
    "base fit": 0.3,
    "algorithms 1 and 2": 0.6,
    "grammar": 0.4,
    "estimated surface": 2.1,
    "smoothing": 0.8,
    "curvature": 0.4,
}
# A chain until it converges costs so many times the fast path (`explore3d bench`, posterior)
CHAIN = 4.0


def with_savings(left_out: Sequence[LeftOut], timings: Mapping[str, float]) -> tuple[LeftOut, ...]:
    """The same stages, each with an estimate of the seconds that it would have taken where there is one."""
    return tuple(each if each.saved else replace(each, saved=_estimate(each.stage, timings)) for each in left_out)


def _estimate(stage: str, timings: Mapping[str, float]) -> str:
    if stage == "long chain":
        return _about(CHAIN * timings.get("posterior", 0.0), "4 times the fast path")
    if stage in RATIOS and "detection" in timings:
        return _about(RATIOS[stage] * timings["detection"], f"{RATIOS[stage]:g} times the detection")
    return ""


def _about(seconds: float, why: str) -> str:
    return f"about {seconds_text(seconds)} (estimated: {why})" if seconds > 0 else ""
