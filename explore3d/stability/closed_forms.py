"""Stability of the closed forms, over the extremes of their arguments, against 60 decimal digits.

Beside each stands the form that the paper or a textbook prints, where that one loses digits.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from decimal import Decimal
from math import acos, hypot, isfinite, nan, sqrt

import numpy as np

from explore3d.stability.exact_decimal import Formula, arctan, condition, exact, relative_error
from explore3d.stability.table import EPS, SLACK, Answer, Case
from mapping.geometry.templates import BumpOfRevolution, cap_height, contact_half_width, groove_height, kink_angle
from mapping.instrument import Noise

Float = Callable[..., float]
TIPS = (1e-9, 1e-2, 1e3)
STEEPNESS_RANGE = tuple(10.0**k for k in range(-3, 10))
# Distances from the bump's axis in its own width 1/sqrt(a); 1/sqrt(3) is the inflection
AXIS_DISTANCES = (1e-8, 1e-3, 0.3, 0.577350269189, 0.6, 1.0, 3.0, 1e3)


def form(
    name: str,
    asked: str,
    formula: Formula,
    ours: Float,
    arguments: Iterable[Sequence[float]],
    paper: Float | None = None,
) -> Case:
    """A case: the worst over all arguments, measured by how much of the allowed error it takes."""

    def run() -> Answer:
        count, worst, printed = 0, Answer(""), nan
        share = -1.0
        for each in arguments:
            count += 1
            true, allowed = exact(formula, each), condition(formula, each)
            error = relative_error(ours(*each), true)
            if not isfinite(error) or error / allowed > share:
                share = error / allowed if isfinite(error) else np.inf
                where = ", ".join(f"{x:.3g}" for x in each)
                worst = Answer(f"worst at ({where}): {ours(*each):.6g}", error, allowed)
            if paper is not None:
                lost = relative_error(paper(*each), true)
                if lost > SLACK * EPS * allowed:
                    printed = lost if not printed >= lost else printed
        why = "well-posed" if worst.condition < 1e3 else "the answer passes through zero near by"
        return Answer(f"{count} arguments, {worst.found}", worst.error, worst.condition, reason=why, paper=printed)

    return Case("closed forms", name, asked, run)


# The paper's bump ---------------------------------------------------------------------------------------------------


def _dc(u: Decimal, a: Decimal) -> tuple[Decimal, Decimal]:
    d = 1 + a * u * u
    return d, (1 + 4 * a * a * u * u / d**4).sqrt()


def _radial(u: Decimal, a: Decimal) -> Decimal:
    d, c = _dc(u, a)
    return 2 * a * (1 - 3 * a * u * u) / (c * d) ** 3


def _around(u: Decimal, a: Decimal) -> Decimal:
    d, c = _dc(u, a)
    return 2 * a / (c * d * d)


def _parallel_place(u: Decimal, a: Decimal, r: Decimal) -> Decimal:
    d, c = _dc(u, a)
    return u + 2 * a * r * u / (c * d * d)


def _parallel_height(u: Decimal, a: Decimal, r: Decimal) -> Decimal:
    d, c = _dc(u, a)
    return 1 / d + r / c


def _opening(u: Decimal, a: Decimal, r: Decimal) -> Decimal:
    return 1 + r * _radial(u, a)


def _bump_places() -> Iterable[tuple[float, float]]:
    return ((place / sqrt(a), a) for a in STEEPNESS_RANGE for place in AXIS_DISTANCES)


def _bump_places_and_tips() -> Iterable[tuple[float, float, float]]:
    return ((*pair, r) for pair in _bump_places() for r in TIPS)


# Wires, grooves, umbilics, noise ------------------------------------------------------------------------------------


def _cap(x: Decimal, height: Decimal, radius: Decimal, tip: Decimal) -> Decimal:
    total = radius + tip
    return height - total + ((total - x) * (total + x)).sqrt()


def _wires(share: float = 0.5) -> Iterable[tuple[float, float, float, float]]:
    """A wire of a 1e-12th to twice the tip's radius, at a share of its half width."""
    for tip, ratio in itertools.product(TIPS, (1e-12, 1e-9, 1e-6, 1e-3, 0.0325, 0.5, 2.0)):
        radius = ratio * tip
        yield share * float(contact_half_width(2 * radius, radius, tip)), 2 * radius, radius, tip


def _kink(radius: Decimal, tip: Decimal) -> Decimal:
    return 2 * arctan((radius / tip).sqrt())


def _dip(width: Decimal, tip: Decimal) -> Decimal:
    return tip - (tip * tip - width * width / 4).sqrt()


def _split(a: Decimal, b: Decimal, c: Decimal) -> Decimal:
    return 2 * (((a - c) / 2) ** 2 + b * b).sqrt()


def _split_as_printed(a: float, b: float, c: float) -> float:
    mean, gauss = 0.5 * (a + c), a * c - b * b
    return 2 * sqrt(max(mean * mean - gauss, 0.0))


def _radius_from_curvature(radius: float, tip: float) -> float:
    return 1 / (1 / (radius + tip)) - tip


def _mean_of_walk(x: Decimal) -> Decimal:
    return 2 * (x + (-x).exp() - 1) / (x * x)


def interference_of_bump() -> Answer:
    """The two contacts of the ball at the bump's kink: their centres must be one point."""
    worst, count, where = 0.0, 0, ""
    for a, r in itertools.product(STEEPNESS_RANGE, (1e-3, 1e-1, 1.0, 1e3)):
        pair = BumpOfRevolution(a).interference(r)
        if pair is None:
            continue
        count += 1
        gap = [
            float(abs(exact(each, (pair[0], a, r)) - exact(each, (pair[1], a, r))))
            for each in (_parallel_place, _parallel_height)
        ]
        # an error of u moves the centre by at most (1 + r k) times as much; k is 2 a at most
        if hypot(*gap) / r > worst:
            worst, where = hypot(*gap) / r, f"a = {a:g}, r = {r:g}"
    return Answer(
        f"{count} bumps with a kink, centres apart by {worst:.0e} r at most ({where})", worst, 1.0, 1e-11,
        "a root within 1e-14 of its own size, steepened by the flank",
    )  # fmt: skip


def _bump(method: str, index: int) -> Float:
    def value(u: float, a: float, *r: float) -> float:
        return float(getattr(BumpOfRevolution(a), method)(u, *r)[index])

    return value


CLOSED_FORM_CASES = [
    form("bump's curvature, radial", "2a(1-3au²)/(c³d³), a from 1e-3 to 1e9", _radial, _bump("curvatures", 0),
         list(_bump_places())),
    form("bump's curvature, around", "2a/(cd²), a from 1e-3 to 1e9", _around, _bump("curvatures", 1),
         list(_bump_places())),
    form("parallel surface, place (the paper's eq. 11)", "a from 1e-3 to 1e9, r from 1e-9 to 1e3", _parallel_place,
         _bump("parallel", 0), list(_bump_places_and_tips())),
    form("parallel surface, height (the paper's eq. 11)", "a from 1e-3 to 1e9, r from 1e-9 to 1e3", _parallel_height,
         _bump("parallel", 1), list(_bump_places_and_tips())),
    form("caustics: 1 + r k", "near where the parallel surface folds", _opening,
         lambda u, a, r: 1 + r * float(BumpOfRevolution(a).curvatures(u)[0]), list(_bump_places_and_tips())),
    Case("closed forms", "interference points of the bump", "one centre from both contacts, a from 1e-3 to 1e9",
         interference_of_bump),
    form("trace over a wire", "height at half its width, wires from 1e-12 to 2 tip radii", _cap,
         lambda x, h, a, r: float(cap_height(x, h, a, r)), list(_wires()),
         lambda x, h, a, r: a - r + sqrt((r + a) ** 2 - x**2)),
    form("trace over a wire, near its kink", "at 0.999 of its half width", _cap,
         lambda x, h, a, r: float(cap_height(x, h, a, r)), list(_wires(0.999)),
         lambda x, h, a, r: a - r + sqrt((r + a) ** 2 - x**2)),
    form("kink beside a wire", "angle, wires from 1e-12 to 2 tip radii", _kink,
         lambda a, r: float(kink_angle(2 * a, a, r)), [(a, r) for _, _, a, r in _wires()],
         lambda a, r: acos((r - a) / (r + a))),
    form("dip over a groove", "r - sqrt(r² - b²/4), width from 1e-9 to 1.99 r", _dip,
         lambda b, r: -float(groove_height(0.0, b, r)),
         [(q * r, r) for q in (1e-9, 1e-6, 1e-3, 0.1, 1.99) for r in TIPS],
         lambda b, r: r - sqrt(r * r - b * b / 4)),
    form("size of a wire", "radius back from the trace: from its height; printed: from its curvature",
         lambda a, r: +a, lambda a, r: 0.5 * float(cap_height(0.0, 2 * a, a, r)),
         [(a, r) for _, _, a, r in _wires()], _radius_from_curvature),
    form("umbilic: k1 - k2", "2 hypot((a-c)/2, b) down to a difference of 1e-15", _split,
         lambda a, b, c: 2 * hypot(0.5 * (a - c), b),
         [(100.0, 1e-9 * 100 * q, 100.0 * (1 + q)) for q in (1e-15, 1e-12, 1e-8, 1e-4, 1.0)], _split_as_printed),
    form("variance of a correlated mean", "over 1e-9 to 1e3 correlation lengths", _mean_of_walk,
         lambda x: float(Noise(0.0, 1.0, 1.0).block_covariances(1, x, 1.0)[0]), [(10.0**k,) for k in range(-9, 4)],
         lambda x: 2 * (x + float(np.exp(-x)) - 1) / x**2),
    form("circle's half width", "sqrt(H(2R - H)) of a wire", lambda h, a, r: (h * (2 * (a + r) - h)).sqrt(),
         lambda h, a, r: float(contact_half_width(h, a, r)), [(h, a, r) for _, h, a, r in _wires()]),
]  # fmt: skip
