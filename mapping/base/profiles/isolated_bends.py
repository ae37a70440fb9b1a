"""Isolated bends: what an automatic base took for form although it stands alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.instrument import robust_fit, robust_scale

# A bend of a base stands alone if it leaves what the rest of the base bends about by so many of that scatter, over
# less than this share of the length: form bends everywhere. Simulated on 480 places, 1500 random forms each: forms
# correlated over 1/40, 1/20 and 1/10 of the length leave their scatter by 6 somewhere in 0.3, 3 and 9 % of profiles
# (which costs a note); lone bumps as wide at half height as a fifth of the length keep all of their height
# beside the robust parabola, and as wide as a quarter 66 to 91 %: wider ones are the parabola's.
ALONE_SDS, LONGEST_BEND_SHARE = 6.0, 0.25
# Places that a parabola through a bend must hold: two more than it has coefficients
_FEWEST_OF_CREST = 5


@dataclass(frozen=True)
class Bend:
    """A stretch of a profile that stands alone: height (signed), width at half of it, and place along it, m."""

    height: float
    width: float
    place: float


def isolated_bends(x: FloatArray, z: FloatArray, line: FloatArray, noise: float) -> list[Bend]:
    """Where a fitted line stands alone against a parabola through all of it; the highest first.

    Args:
        x, z: (N,) the profile, in the order of x, m.
        line: (N,) the line that was fitted to it, m.
        noise: scatter of the profile from place to place, m.
    """
    u = np.linspace(-1.0, 1.0, len(x))
    design = np.column_stack([np.ones_like(u), u, u * u])
    floor = max(noise, np.finfo(float).tiny)
    rough = max(robust_scale(robust_fit(design, line, floor).residual), floor)
    fit = robust_fit(design, line, rough)
    return _alone(x, fit.residual, z - design @ fit.coefficients, max(robust_scale(fit.residual), floor))


def isolated_rest(x: FloatArray, z: FloatArray, line: FloatArray, noise: float, narrowest: float) -> list[Bend]:
    """Where a profile stands alone off the line that was fitted to it; the highest first.

    Args:
        x, z: (N,) the profile, in the order of x, m.
        line: (N,) the line that was fitted to it, m.
        noise: scatter of the profile from place to place, m.
        narrowest: width at half height above which a stretch counts, m.
    """
    usual = max(robust_scale(z - line), noise, np.finfo(float).tiny)
    return [bend for bend in _alone(x, z - line, z - line, usual) if bend.width > narrowest]


def _alone(x: FloatArray, told: FloatArray, off: FloatArray, usual: float) -> list[Bend]:
    """Stretches in which what is told leaves its usual scatter, measured in what is off, the highest first."""
    found = []
    for sign in (-1.0, 1.0):
        out = np.concatenate([[False], sign * told > ALONE_SDS * usual, [False]])
        edges = np.flatnonzero(np.diff(out.astype(int)))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            inside = begin > 0 and end < len(x)  # what goes on beyond the profile's end is no detail
            shown = bool((sign * off[begin:end] > 0.0).any())  # a line may swing to where nothing is
            if inside and shown and float(x[end] - x[begin]) < LONGEST_BEND_SHARE * float(x[-1] - x[0]):
                found.append(_measured(x, off, begin, end, sign))
    chosen: list[Bend] = []
    for bend in sorted(found, key=lambda bend: -abs(bend.height)):
        # a line that follows a scratch swings beside it
        beside = any(abs(bend.place - other.place) < other.width for other in chosen)
        if not beside and abs(bend.height) > ALONE_SDS * usual:
            chosen.append(bend)
    return chosen


def _measured(x: FloatArray, off: FloatArray, begin: int, end: int, sign: float) -> Bend:
    """What the profile itself shows there: the line has rounded it.

    The height is that of a parabola through all that reaches half of it: the highest place alone is high by its noise.
    """
    top = begin + int(np.argmax(sign * off[begin:end]))
    height = float(sign * off[top])
    for _ in range(2):
        low = sign * off < 0.5 * height
        before, after = np.flatnonzero(low[:top]), np.flatnonzero(low[top:])
        first = int(before[-1]) if len(before) else 0
        last = top + int(after[0]) if len(after) else len(x) - 1
        top = first + 1 + int(np.argmax(sign * off[first + 1 : last]))
        height = _crest(sign * off[first + 1 : last])
    return Bend(sign * height, float(x[last] - x[first]), float(x[top]))


def _crest(z: FloatArray) -> float:
    """The highest of the parabola through all heights of a bend; of the heights themselves where they are few."""
    if len(z) < _FEWEST_OF_CREST:
        return float(z.max())
    u = np.linspace(-1.0, 1.0, len(z))
    return float(np.polyval(np.polyfit(u, z, 2), u).max())
