"""Kernels of hw.simulated.dynamics: the motion of a mass on a stiff, critically damped contact, in closed form."""

from __future__ import annotations

from math import exp, inf, sqrt
from typing import Any

import numpy as np
from numba import njit

Array = Any


@njit(cache=True)  # type: ignore[untyped-decorator]
def ride(
    times: Array, heights: Array, sampled: Array, mass: float, stiffness: float, force: float, gain: float, out: Array
) -> int:
    """Ride over a piecewise linear profile; how many pieces (contact or flight) were solved.

    In the frame of the profile the gap y (positive: off the body) obeys  m y'' + c y' + k y = -u  in contact,
    c = 2 sqrt(k m), and  m y'' = -u  in flight. u is held between control instants: u = F0 + gain (F0 - F), kept
    between 0 and 2 F0: answered in proportion, the force of an impact would throw the tip off the body.

    Args:
        times, heights: (N,) corners of the profile: s, m.
        sampled: (N,) True at control instants, when the force is measured and the command renewed.
        out: (N, 2) gap y (m) and contact force (N) at the corners.
    """
    omega, damping = sqrt(stiffness / mass), 2.0 * sqrt(stiffness * mass)
    gap, speed, command = -force / stiffness, 0.0, force
    touching, felt, pieces = True, force, 0
    slope = 0.0
    for i in range(len(times)):
        span = times[i + 1] - times[i] if i + 1 < len(times) else 0.0
        new = (heights[i + 1] - heights[i]) / span if span > 0.0 else slope
        bend = new - slope if i > 0 else 0.0
        if touching and i > 0:
            # at a corner of a curve drawn as chords, the mean of both slopes is that of the curve
            felt = max(0.0, -stiffness * gap - damping * (speed - 0.5 * bend))
        out[i, 0], out[i, 1] = gap, felt
        if span <= 0.0:
            continue
        if sampled[i]:
            command = min(max(force + gain * (force - felt), 0.0), 2.0 * force)
        slope = new
        speed -= bend
        left = span
        while left > 0.0:
            pieces += 1
            if touching:
                rest = -command / stiffness
                a, b = gap - rest, speed + omega * (gap - rest)
                lost = _leaves(a, b, omega, command, stiffness, left)
                step = min(lost, left)
                decay = exp(-omega * step)
                gap = rest + (a + b * step) * decay
                speed = (b - omega * (a + b * step)) * decay
                touching = lost > left
                left -= step
                felt = 0.0
            else:
                pull = command / mass
                land = _lands(gap, speed, pull, left)
                step = min(land, left)
                gap, speed = gap + speed * step - 0.5 * pull * step * step, speed - pull * step
                touching = land <= left
                left -= step
                felt = 0.0
    return pieces


@njit(cache=True)  # type: ignore[untyped-decorator]
def _force(t: float, a: float, b: float, omega: float, command: float, stiffness: float) -> float:
    """Contact force a time t into a piece: -k y - c y'."""
    decay = exp(-omega * t)
    return command - stiffness * ((a + b * t) + 2.0 / omega * (b - omega * (a + b * t))) * decay


@njit(cache=True)  # type: ignore[untyped-decorator]
def _leaves(a: float, b: float, omega: float, command: float, stiffness: float, left: float) -> float:
    """When the force falls through zero, inf if not before `left`.

    The force has one extremum at most: between it and either end it is monotone, and bisection is safe.
    """
    # F(t) = command - k ((2 b / omega - a) - b t) e^(-omega t); its derivative vanishes where:
    turn = (3.0 * b - a * omega) / (b * omega) if b != 0.0 else inf
    first, second = left, left
    if 0.0 < turn < left:
        first = turn
    low = 0.0
    # a piece that begins at landing or lift-off may begin with no force at all
    if (
        _force(0.0, a, b, omega, command, stiffness) <= 0.0
        and _force(1e-3 * first, a, b, omega, command, stiffness) <= 0.0
    ):
        return 0.0
    for end in (first, second):
        if _force(end, a, b, omega, command, stiffness) <= 0.0:
            high = end
            for _ in range(80):
                middle = 0.5 * (low + high)
                if _force(middle, a, b, omega, command, stiffness) > 0.0:
                    low = middle
                else:
                    high = middle
            return high
        low = end
    return inf


@njit(cache=True)  # type: ignore[untyped-decorator]
def _lands(gap: float, speed: float, pull: float, left: float) -> float:
    """When a free flight ends on the profile, inf if not before `left`."""
    if gap <= 0.0 and speed <= 0.0:
        return 0.0
    root = speed * speed + 2.0 * pull * gap
    if pull == 0.0:
        land = -gap / speed if speed < 0.0 else inf
    elif root < 0.0:
        land = inf
    elif pull > 0.0:
        land = (speed + sqrt(root)) / pull
    else:
        land = 2.0 * gap / (-speed + sqrt(root)) if speed < 0.0 else inf
    return land if land <= left else inf


def new_out(count: int) -> Array:
    """Room for the result of `ride`."""
    return np.empty((count, 2))
