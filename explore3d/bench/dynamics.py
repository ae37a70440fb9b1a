"""Dynamics bench: how long a second of stiff contact takes to simulate, and how exact it is, over the stiffness."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass

import numpy as np

from hw.simulated import Dynamics
from mapping import FloatArray

SPEED, TIP_RADIUS, WIRE = 0.03, 0.01, 0.65e-3


@dataclass(frozen=True)
class DynamicsCost:
    """One point of the curve: SI units; `cost` is computing time per simulated second, `error` against a tolerance a
    thousand times finer, `deviation` the root mean square gap to the rigid trace while in contact."""

    stiffness: float
    mass: float
    rate: float
    cost: float
    error: float
    deviation: float
    corners: int


def wire_trace(times: FloatArray) -> FloatArray:
    """Height (N,) of the ball over the paper's wire crossed at 30 mm/s (theory section 4), m; again every 0.5 s."""
    arm = TIP_RADIUS + WIRE / 2
    x = np.clip(SPEED * (np.asarray(times) % 0.5) - 0.0075, -arm, arm)
    return np.maximum(WIRE - x**2 / (arm + np.sqrt((arm - x) * (arm + x))), 0.0)


def dynamics_curve(
    stiffness: FloatArray | None = None, masses: tuple[float, ...] = (1e-3, 3e-2, 1.0), rate: float = 5000.0
) -> list[DynamicsCost]:
    """The curve over stiffness (N/m, default 1e2 to 1e9) for some masses (kg), at a control rate (Hz)."""
    stiff = 10.0 ** np.arange(2, 10) if stiffness is None else stiffness
    times = np.arange(int(rate)) / rate
    Dynamics().ride(wire_trace, times[:100], 1.0)  # compile
    curve = []
    for mass in masses:
        for k in stiff:
            tip = Dynamics(mass=mass, stiffness=float(k))
            begun = time.perf_counter()
            ride = tip.ride(wire_trace, times, 1.0)
            cost = time.perf_counter() - begun
            finer = Dynamics(mass=mass, stiffness=float(k), tolerance=1e-3 * tip.tolerance)
            error = float(np.abs(ride.gap - finer.ride(wire_trace, times, 1.0).gap).max())
            touching = ride.gap[ride.force > 0.0]
            deviation = float(np.sqrt(np.mean(touching**2)))
            curve.append(DynamicsCost(float(k), mass, rate, cost, error, deviation, ride.corners))
    return curve


def dynamics_table(curve: list[DynamicsCost]) -> str:
    """The curve as CSV."""
    rows = [asdict(point) for point in curve]
    return "\n".join([",".join(rows[0]), *(",".join(f"{value:.6g}" for value in row.values()) for row in rows)]) + "\n"
