"""Form: what the base of a profile may be, as its user says it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapping import BoolArray, FloatArray, FormError, Trace
from mapping.instrument import robust_fit

POSSIBLE_FORMS = "auto, line, arc, poly:N with N from 1 to 12, gaussian:WAVELENGTH such as gaussian:0.8mm, none"
# The normal equations in the splines' basis have the condition 5e6 at degree 12, 3e8 at 15 and 2.5e11 at 20: of 16
# digits as many are left as a height needs against its noise (1e-9) with no more than that
HIGHEST_FORM_DEGREE = 12
UNITS_OF_LENGTH = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9}
# ISO 16610-21: the weighting function exp(-pi (x / (alpha cutoff))^2) transmits half of a wave of the cutoff's length
GAUSSIAN_ALPHA = float(np.sqrt(np.log(2.0) / np.pi))
# ISO 16610-31 ends the weighting function at half a cutoff to either side, and calls a residual beyond 4.447 times the
# median of all an outlier (three standard deviations: 3 x 1.4826); it converges in a few rounds, the rest is reserve
GAUSSIAN_REACH, GAUSSIAN_OUTLIER, GAUSSIAN_ROUNDS = 0.5, 4.447, 12
# Places a cutoff at which the mean line is computed: a chord of a wave of the cutoff's length misses it by
# (2 pi / 100)^2 / 8 = 5e-4 of its height. Together no more than for 200 cutoffs, which is 40 of the evaluation lengths
# that ISO 21920 measures over; beyond, places lie wider
PLACES_PER_CUTOFF = 100
MOST_FORM_PLACES = 20_000
# Where less than this share of a window's weight is trusted, a feature fills it: then all of it counts. A line through
# a fiftieth of the samples scatters seven times as much as one through all
LEAST_TRUST = 0.02
# That a base is fitted to beside masks: twice the coefficients of a cubic, so that there is a residual to judge by
FEWEST_SAMPLES = 8


@dataclass(frozen=True)
class Form:
    """How a base is fitted.

    Args:
        kind: "auto" (the evidence chooses), "line", "arc", "poly", "gaussian" or "none" (a level line).
        degree: of a polynomial.
        cutoff: of the Gaussian filter, m.
        masks: (from, to) in x of the object's frame, m: stretches that the base is not fitted to.
    """

    kind: str = "auto"
    degree: int = 0
    cutoff: float = 0.0
    masks: tuple[tuple[float, float], ...] = ()

    @classmethod
    def read(cls, text: str, masks: Sequence[str] = ()) -> Form:
        """The form that a text says, and masks such as "1.2mm..1.4mm".

        Raises:
            FormError: it says none.
        """
        stretches = tuple(_stretch(mask) for mask in masks)
        kind, _, value = text.strip().partition(":")
        if kind in ("auto", "line", "arc", "none") and not value:
            return cls(kind, masks=stretches)
        if kind == "poly" and value.strip().isdecimal() and 1 <= int(value) <= HIGHEST_FORM_DEGREE:
            return cls(kind, degree=int(value), masks=stretches)
        if kind == "gaussian" and (cutoff := _length(value)) > 0:
            return cls(kind, cutoff=cutoff, masks=stretches)
        raise FormError(f"form {text!r} is not known; possible: {POSSIBLE_FORMS}")

    def unmasked(self, trace: Trace) -> BoolArray:
        """(N,) True of the samples that the base is fitted to.

        Raises:
            FormError: there is hardly anything, or the masks leave it.
        """
        x = trace.centers[:, 0]
        keep = np.ones(len(x), dtype=bool)
        for low, high in self.masks:
            keep &= (x < low) | (x > high)
        if keep.sum() < FEWEST_SAMPLES:
            found = f"{len(keep)} sample{'s' * (len(keep) != 1)}"
            if self.masks:
                asked = ", ".join(f"{low:g}..{high:g} m" for low, high in self.masks)
                found += f", of which the masks {asked} leave {keep.sum()}"
            raise FormError(f"the base of a profile needs at least {FEWEST_SAMPLES} samples; found {found}")
        return keep


AUTO = Form()


def _stretch(text: str) -> tuple[float, float]:
    low, dots, high = text.partition("..")
    try:
        ends = (_metres(low), _metres(high))
    except ValueError:
        ends = (0.0, 0.0)
    if not dots or not ends[0] < ends[1]:
        raise FormError(
            f"mask {text!r} is no stretch in x; possible: FROM..TO with units, FROM below TO, say 1.2mm..1.4mm"
        )
    return ends


def _length(text: str) -> float:
    """Metres of a text such as "0.8 mm"; 0 if it is no length with a unit."""
    try:
        value = _metres(text)
    except ValueError:
        return 0.0
    return value if np.isfinite(value) else 0.0


def _metres(text: str) -> float:
    text = text.strip()
    unit = next((u for u in sorted(UNITS_OF_LENGTH, key=len, reverse=True) if text.endswith(u)), "")
    if not unit:
        raise ValueError(f"unit missing in {text!r}")  # 1..2 of a profile in mm would be metres
    return float(text.removesuffix(unit)) * UNITS_OF_LENGTH[unit]


def form_line(
    x: FloatArray, z: FloatArray, form: Form, scale: float, ends: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """The line of a form (M,), m, through a profile, at places (M,) that reach from its one end to the other.

    Lines, arcs and polynomials are fitted by robust least squares; the Gaussian is a robust regression filter of the
    first order (ISO 16610-31), whose transmission is that of ISO 16610-21 inside. At the ends, over half a cutoff, the
    part of the window that exists is fitted by a line: none of the profile is cut off, and a slope stays a slope.

    Args:
        x, z: (N,) the profile in the order of x, m.
        form: not "auto".
        scale: standard deviation of z where there is no feature, m.
        ends: where the line begins and ends, m.

    Raises:
        FormError: a cutoff longer than the profile or shorter than its samples are apart.
    """
    if form.kind == "gaussian":
        return _gaussian(x, z, form.cutoff, ends)
    places = np.linspace(*ends, 1 + 64 * 16)
    if form.kind == "arc":
        return places, _arc(x, z, scale, places)
    degree = {"none": 0, "line": 1}.get(form.kind, form.degree)
    middle, half = 0.5 * (x[0] + x[-1]), 0.5 * (x[-1] - x[0])
    design = np.polynomial.legendre.legvander((x - middle) / half, degree)
    fit = robust_fit(design, z, scale)
    return places, np.polynomial.legendre.legvander((places - middle) / half, degree) @ fit.coefficients


def _arc(x: FloatArray, z: FloatArray, scale: float, places: FloatArray) -> FloatArray:
    """Height of a circular arc, by height, slope and curvature at its middle: a line is an arc of curvature 0."""
    from scipy.optimize import least_squares

    middle, half = 0.5 * (x[0] + x[-1]), 0.5 * (x[-1] - x[0])
    u, size = (x - middle) / half, max(float(np.ptp(z)), 1e-12 * half)
    parabola = robust_fit(np.column_stack([np.ones_like(u), u, 0.5 * u * u]), z, scale).coefficients

    def height(theta: FloatArray, at: FloatArray) -> FloatArray:
        # the circle through (0, z0) with slope m and curvature k: k (u^2 + y^2) / 2 = (y - m u) / sqrt(1 + m^2)
        z0, slope, curvature = theta[0], theta[1] / half, theta[2] / half**2
        along, q = half * at, 1 / np.sqrt(1 + slope**2)
        c = q * slope * along + 0.5 * curvature * along**2
        return np.asarray(z0 + 2 * c / (q + np.sqrt(np.maximum(q**2 - 2 * curvature * c, 1e-6))))

    floor = max(scale, 1e-9 * size)

    def residual(theta: FloatArray) -> FloatArray:
        return np.asarray((height(theta * size, u) - z) / floor)

    best = least_squares(residual, parabola / size, loss="soft_l1", x_scale="jac", xtol=1e-14)
    return height(best.x * size, (places - middle) / half)


def _gaussian(x: FloatArray, z: FloatArray, cutoff: float, ends: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    length = ends[1] - ends[0]
    apart = length / max(len(x) - 1, 1)
    if not 4 * apart < cutoff <= length:
        raise FormError(
            f"a Gaussian form's wavelength must lie between four steps ({4 * apart:.3g} m) and the length of the "
            f"profile ({length:.3g} m); found {cutoff:.3g} m"
        )
    count = int(np.clip(np.ceil(PLACES_PER_CUTOFF * length / cutoff), 64, MOST_FORM_PLACES)) + 1
    places = np.linspace(*ends, count)
    low, high = (
        np.searchsorted(x, places - GAUSSIAN_REACH * cutoff),
        np.searchsorted(x, places + GAUSSIAN_REACH * cutoff, side="right"),
    )
    trust, line = np.ones(len(x)), np.zeros(count)
    for _ in range(GAUSSIAN_ROUNDS):
        before = line
        line = np.array(
            [_line_at(x[a:b] - p, z[a:b], trust[a:b], cutoff) for p, a, b in zip(places, low, high, strict=True)]
        )
        residual = z - np.interp(x, places, line)
        limit = GAUSSIAN_OUTLIER * max(float(np.median(np.abs(residual))), np.finfo(float).tiny)
        trust = np.clip(1 - (residual / limit) ** 2, 0.0, None) ** 2
        if np.abs(line - before).max() < 1e-3 * limit:
            break
    return places, line


def _line_at(u: FloatArray, z: FloatArray, trust: FloatArray, cutoff: float) -> float:
    """Height at 0 of the weighted least-squares line; of the plain one where a feature fills the window."""
    gauss = np.exp(-np.pi * (u / (GAUSSIAN_ALPHA * cutoff)) ** 2)
    weight = gauss * trust
    if weight.sum() < LEAST_TRUST * gauss.sum():
        weight = gauss
    s0, s1, s2 = weight.sum(), (weight * u).sum(), (weight * u * u).sum()
    t0, t1 = (weight * z).sum(), (weight * u * z).sum()
    determinant = s0 * s2 - s1 * s1
    return float((s2 * t0 - s1 * t1) / determinant) if determinant > 1e-12 * s0 * s2 else float(t0 / s0)
