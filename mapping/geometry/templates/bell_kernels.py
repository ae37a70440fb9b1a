"""Compiled traces of bells: bumps of revolution with a skirt, dilated by the ball along their meridian."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray

# Places of the table of the trace: between them it errs by 1e-5 of the bump's height or less where the trace is smooth.
TABLE_PLACES = 500
# A step along the meridian turns it by so much at most, rad, and is at most this share of the length over which the
# bell changes: the cubics between the points then err by 1e-6 of its height, 2e-5 at worst, against steps of 1e-3,
# and on needles of a hundredth of the tip's radius, too, where 600 steps by one rule erred by 1e-2. A shallow bell
# takes 60 steps.
TURN_A_STEP = 0.03
SHARE_A_STEP = 0.07
# Beyond the place where a bell is so small a part of its height there is nothing left to walk.
GONE = 1e-8


@njit(cache=True, error_model="numpy", nogil=True)
def bell_trace(height: float, scale: float, exponent: float, tip: float, table: FloatArray, spacing: float) -> None:
    """Heights of the ball over the plane at distances 0, spacing, ... from the axis, written to `table`.

    The meridian z = H (1 + u^2 / (p w^2))^-p is walked in steps that follow its bend and its scale; the ball's centre
    over each point is on the parallel curve (paper, equation 11), and where that crosses itself the highest branch is
    the trace (interference points).
    """
    table[:] = 0.0
    last = spacing * (len(table) - 1)
    u, z, base, slope = 0.0, height, 1.0, 0.0
    rho0, t0, slope0 = 0.0, height, 0.0
    while u < last and abs(z) > GONE * abs(height):
        squeeze = scale * scale * base
        bend = -2.0 * z / squeeze * (1.0 - 2.0 * (exponent + 1.0) / exponent * u * u / squeeze)
        step = SHARE_A_STEP * scale * np.sqrt(base)
        if step * abs(bend) > TURN_A_STEP * (1.0 + slope * slope):
            step = TURN_A_STEP * (1.0 + slope * slope) / abs(bend)
        u += step
        base = 1.0 + (u / scale) ** 2 / exponent
        z = height * base**-exponent
        slope = -2.0 * z * u / (scale * scale * base)
        stretch = np.sqrt(1.0 + slope * slope)
        rho = u - tip * slope / stretch
        # r/c - r in the form that keeps its digits on the flat skirt
        t = z - tip * slope * slope / (stretch * (1.0 + stretch))
        low, high = min(rho0, rho), max(rho0, rho)
        first = int(np.ceil(low / spacing))
        for k in range(first, min(int(high / spacing), len(table) - 1) + 1):
            # a cubic: the parallel curve has the slope of the meridian, and few points over a sharp crest
            run = rho - rho0
            x = (k * spacing - rho0) / run if run != 0.0 else 0.0
            bow = (1.0 - x) * (slope0 * run - (t - t0)) + x * ((t - t0) - slope * run)
            table[k] = max(table[k], t0 + x * (t - t0) + x * (1.0 - x) * bow)
        rho0, t0, slope0 = rho, t, slope


@njit(cache=True, error_model="numpy", nogil=True)
def bell_heights(
    x: FloatArray,
    y: FloatArray,
    places: FloatArray,
    heights: FloatArray,
    scales: FloatArray,
    exponents: FloatArray,
    tip: float,
    out: FloatArray,
) -> None:
    """Heights (W, n) of W bells over bins with nodes at tangent coordinates x, y (n, q); `places` (W, 2)."""
    walkers, bins = out.shape
    nodes = x.shape[1]
    table = np.zeros(TABLE_PLACES)
    for w in range(walkers):
        far = 0.0
        for i in range(bins):
            for q in range(nodes):
                far = max(far, (x[i, q] - places[w, 0]) ** 2 + (y[i, q] - places[w, 1]) ** 2)
        spacing = max(np.sqrt(far), 1e-3 * tip) / (TABLE_PLACES - 2)
        bell_trace(heights[w], scales[w], exponents[w], tip, table, spacing)
        for i in range(bins):
            total = 0.0
            for q in range(nodes):
                away = np.sqrt((x[i, q] - places[w, 0]) ** 2 + (y[i, q] - places[w, 1]) ** 2) / spacing
                k = int(away)
                total += table[k] + (away - k) * (table[k + 1] - table[k])
            out[w, i] = total / nodes
