"""Stability of stiff contact: stiffness from 1e2 to 1e9 N/m, against a tolerance a thousand times finer."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from explore3d.bench import wire_trace
from explore3d.stability.table import Answer, Case
from hw.simulated import Dynamics

SAMPLE_RATE, MASS, FORCE = 5000.0, 0.1, 1.0


def explicit(stiffness: float, times: int = 2000) -> float:
    """Largest gap by explicit steps of the control's period, on a flat body, over F/k: what is avoided here."""
    step, gap, speed = 1.0 / SAMPLE_RATE, 0.0, 0.0
    damping = 2.0 * np.sqrt(stiffness * MASS)
    largest = abs(gap)
    for _ in range(times):
        push = (-stiffness * gap - damping * speed if gap < 0 else 0.0) - FORCE
        gap, speed = gap + step * speed, speed + step * push / MASS
        largest = max(largest, abs(gap))
        if largest > 1.0:
            break
    return largest * stiffness / FORCE


def stiff(stiffness: float, mass: float = MASS) -> Callable[[], Answer]:
    """Across the paper's wire: the gap against one of finer tolerance, and the force at rest."""

    def run() -> Answer:
        times = np.arange(int(0.55 * SAMPLE_RATE)) / SAMPLE_RATE
        tip = Dynamics(mass=mass, stiffness=stiffness)
        ride = tip.ride(wire_trace, times, FORCE)
        finer = Dynamics(mass=mass, stiffness=stiffness, tolerance=1e-3 * tip.tolerance).ride(wire_trace, times, FORCE)
        error = float(np.abs(ride.gap - finer.gap).max())
        naive = "diverge" if explicit(stiffness) > 100.0 else "hold"
        found = f"gap exact to {error:.1e} m in {ride.corners} corners; explicit steps at 5 kHz {naive}"
        reason = "stated tolerance 1e-8 m, met kink to kink; relative to the wire"
        return Answer(found, error / 0.65e-3, 1.0, tip.tolerance / 0.65e-3, reason)

    return run


def rest() -> Answer:
    """At rest on a flat body the gap is -F/k to the last digit, at every stiffness."""
    worst = 0.0
    for stiffness in 10.0 ** np.arange(2, 10):
        ride = Dynamics(mass=1e-2, stiffness=float(stiffness)).ride(
            lambda t: np.zeros(len(t)), np.arange(int(2 * SAMPLE_RATE)) / SAMPLE_RATE, FORCE
        )
        worst = max(worst, abs(float(ride.gap[-1]) * stiffness / FORCE + 1.0))
    return Answer("8 stiffnesses", worst, 1.0, 1e-9, "decays to rest within 2 s")


STIFFNESSES = [10.0**power for power in range(2, 10)]
DYNAMICS_CASES = [
    *[Case("stiff contact", f"{k:.0e} N/m", "0.1 kg across the wire at 30 mm/s", stiff(k)) for k in STIFFNESSES],
    Case("stiff contact", "1e9 N/m, 1 g", "the stiffest contact under the lightest tip", stiff(1e9, 1e-3)),
    Case("stiff contact", "at rest", "gap -F/k on a flat body", rest),
]
