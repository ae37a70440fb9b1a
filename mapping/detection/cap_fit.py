"""Cap fit: the crest, dip or flat-topped plateau (a Disturbance) that explains a stretch of a profile best."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mapping import FloatArray
from mapping.base import SweepHeights
from mapping.detection.outliers import LEANT
from mapping.geometry.templates import rim_height, step_height
from mapping.instrument import Filter, Noise

# Improvement in twice the log-likelihood that a plateau must bring over a cap.
PLATEAU_GAIN = 12.0
# Averaging a stretch to this many bins costs its fit less than 1 % of its information.
CAP_FIT_BINS = 120
ZOOM_ROUNDS = 5
# Points of a refined grid about the best one, in steps of the grid before
AROUND = np.linspace(-1.0, 1.0, 9)
# Shares of a plateau's half-width that its flanks may take, and how often the best share is refined.
FLANKS = (0.4, 0.02)
FLANK_ROUNDS = 4
# Places to either side of the best, from a tenth of its own standard deviation to a half-width, and half-widths from
# half the best to twice it, over which its likelihood is averaged. Its tops lie on ridges, place against half-width, as
# narrow as one part in the signal-to-noise ratio: steps of 15 % up to 1.5 fell between them. Of 678 crossings of wires
# under a process those held 87 % (rms 1.21 of what is stated); steps of 2.3, 4.7 and 10 % up to 3 hold 91, 90 and 89 %
# (0.95, 0.96, 1.02), of 4.7 % up to 2 as many (0.96).
SPREAD_PLACES, SPREAD_WIDTHS = 24, np.geomspace(0.5, 2.0, 31)
# A stretch is fitted with this share of its length to either side; twice as much where the base may drift. Of 240
# simulated crests, steps and slots a tenth, a quarter, a half and all of it find the same numbers of crossings and the
# same heights; places of wires are off by 0.90, 0.92, 1.01 and 1.04 of what is stated. What is longer meets neighbours.
FITTED_BESIDE = 0.25
# Standard deviations of its place by which a crest may be wider than it seems.
UNSURE = 3.0
# The ball draws no cap higher than w^2 / (2 r); up to twice as high is no reason to ask what it draws instead. That
# saves time alone: of 240 simulated details 1, 1.5, 2 and 3 leave the same 273 crossings, none unfelt; 69, 32, 22 and 8
# of them are asked, in 12.2, 8.9, 8.4 and 7.9 CPU s.
PHYSICAL = 2.0
# Nodes of a bin over which what a ball draws is averaged: beside a wall it is upright. With 16 of them the verdicts of
# 29 simulated details move by at most 0.024 standard deviations, of the 3 that decide.
DRAWN_NODES = 4
# Steps in which its best is looked for: of 4 values, a start near and one of the least radius. Ten times as many change
# none of these verdicts.
DRAWN_STEPS = 300
# A dip between two rims is a cusp (1 - |x| / w)^2: the best cap has 0.61 of its width and 0.77 of its depth, so many
# times the height of a crest's so wide.
CUSP = 2.08


@dataclass(frozen=True, eq=False)
class _Whitened:
    """A window of a profile as its noise lets it be seen.

    Args:
        x: (n,) arclengths of the bins' middles, m, from the profile's first bin.
        step: width of the bins, m.
        filter: whitens what the bins hold.
        basis: (n, drift) whitened orthonormal columns of the drift, which is not seen.
        values: (n,) whitened heights without drift.
    """

    x: FloatArray
    step: float
    filter: Filter
    basis: FloatArray
    values: FloatArray

    def whitened(self, heights: FloatArray) -> FloatArray:
        """What is seen of heights (n,) of the bins, m."""
        seen = self.filter.whiten(heights[None])[0]
        return np.asarray(seen - self.basis @ (self.basis.T @ seen))

    def gains(
        self, place: FloatArray, half_width: FloatArray, flat: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Gain in twice the log-likelihood, height and its information for caps (C,), by least squares."""
        from mapping.detection.filters import cap_products

        steps, gain, scale = self.filter.steps, self.filter.gain, self.filter.scale
        of_bins, of_noise = (self.values, self.basis), (steps.observe, steps.carry, steps.turn, gain, scale)
        found = cap_products(self.x[0], self.step, place, half_width, flat * half_width, *of_bins, *of_noise)
        information = np.maximum(found[:, 0], np.finfo(float).tiny)
        height = found[:, 1] / information
        return height * np.abs(height) * information, height, information


def fit_cap(
    height: FloatArray,
    bounds: tuple[int, int],
    sign: float,
    profile: SweepHeights,
    noise: Noise,
    drift: int,
    tip_radius: float,
    neighbours: tuple[bool, bool] = (False, False),
) -> Disturbance:
    """Generalised least squares over place, half-width and flatness.

    Args:
        height: (n,) heights of the profile, m, with other disturbances removed.
        bounds: first and past-last bin of the stretch.
        sign: +1 for a crest, -1 for a dip.
        profile: where the heights come from.
        noise: of single samples.
        drift: number of polynomial terms of the base that the fit must ignore.
        tip_radius: m; nothing on a trace is sharper.
        neighbours: whether another crest begins right before and right behind: it must not pull at the fit.
    """
    low, high = bounds
    window = _whitened(height, low, high, profile, noise, drift, neighbours)
    spacing = profile.spacing
    half = max(0.5 * (high - low) * spacing, 1.5 * spacing)
    # of the arc about an edge; up a wall the ball goes straight, r before it
    up = min(float(np.abs(height[low:high]).max()), tip_radius)
    sharpest = float(np.sqrt(up * (2.0 * tip_radius - up)))
    crest = _zoom(window, sign, low * spacing, (high - 1) * spacing, half, np.zeros(1))
    # half of an arc between both edges, or they are one crest: by the window, which is wider, and by the fit
    widest = 1.5 * sharpest
    if half > widest and not any(neighbours):
        plateau = _plateau(window, sign, low * spacing, (high - 1) * spacing, half)
        if plateau[0] > crest[0] + PLATEAU_GAIN and plateau[2] > widest:
            crest = plateau
    gain, place, half_width, flat = crest
    shift = 0.05 * half_width
    around, heights, information = window.gains(
        np.array([place - shift, place, place + shift]), np.full(3, half_width), np.full(3, flat)
    )
    bend = float(sign * (2 * around[1] - around[0] - around[2])) / shift**2
    sharp = min(float(np.sqrt(2 / bend)) if bend > 0 else half_width, half_width)
    found = Disturbance(
        place=place + profile.start,
        start=low * spacing + profile.start,
        stop=(high - 1) * spacing + profile.start,
        height=float(heights[1]),
        height_sd=float(1 / np.sqrt(information[1])),
        place_sd=_spread(window, sign, crest, sharp),
        half_width=half_width,
        flat=flat * half_width,
        curvature=2 * float(heights[1]) / (half_width * (1 - flat)) ** 2,
        snr=float(np.sqrt(max(gain, 0.0))),
    )
    if abs(found.height) <= PHYSICAL * found.highest(tip_radius, spacing):
        return found
    drawn = _drawn_gain(window, place, found, tip_radius)
    return replace(found, unlike_ball=float(np.sqrt(max(gain - drawn, 0.0))))


def _drawn_gain(window: _Whitened, place: float, found: Disturbance, tip_radius: float) -> float:
    """Gain in twice the log-likelihood of the best detail that a ball draws over one with upright walls.

    Nothing is narrower than those: arcs about both edges, as high as they are (theory equations 4.7 and 4.8). Free
    are the edges, the height, and the arcs' radius, which is that of the ball or, where it leans, less.
    """
    from scipy.optimize import minimize

    nodes = ((np.arange(DRAWN_NODES) + 0.5) / DRAWN_NODES - 0.5) * window.step
    x = window.x[:, None] + nodes
    least, height = LEANT * tip_radius, abs(found.height)
    # flanks of one height are half as high at one place
    half = found.flat + np.sqrt(0.5) * (found.half_width - found.flat)

    def loss(asked: FloatArray) -> float:
        middle, rest, high, sharp = asked * scale
        radius = min(max(sharp, least), tip_radius)
        inside = max(rest, 0.0) - np.abs(x - middle)
        up = found.height > 0
        drawn = step_height(inside, max(high, 0.0), radius) if up else rim_height(inside, radius, max(high, 0.0))
        seen = window.whitened(drawn.mean(axis=1))
        return float(seen @ seen - 2.0 * seen @ window.values)

    scale = np.array([found.half_width, found.half_width, height, tip_radius])
    best = np.inf
    for radius in (tip_radius, least):
        flank = np.sqrt(radius**2 - max(radius - 0.5 * height, 0.0) ** 2)
        start = np.array([place, max(half - np.sign(found.height) * flank, 0.0), height, radius]) / scale
        best = min(best, float(minimize(loss, start, method="Nelder-Mead", options={"maxiter": DRAWN_STEPS}).fun))
    return -best


def _spread(window: _Whitened, sign: float, crest: tuple[float, float, float, float], sharp: float) -> float:
    """Standard deviation of the place about the best, m, over all places and half-widths that are likely, too.

    In correlated noise the likelihood has more than one top, and the highest is sharper than the truth is near: the
    bend there tells too little. In 178 crossings under a process (signal-to-noise 11) 90 % by the bend held 72 %.

    Args:
        crest: gain, place, half-width, flatness of the best.
        sharp: standard deviation by the bend at the best alone, m.
    """
    _, place, half_width, flat = crest
    away = sharp * np.geomspace(0.1, max(half_width / sharp, 1.0), SPREAD_PLACES)
    away = np.concatenate([-away[::-1], [0.0], away])
    shift, width = (g.ravel() for g in np.meshgrid(away, half_width * SPREAD_WIDTHS))
    gains = sign * window.gains(place + shift, width, np.full(len(shift), flat))[0]
    weight = np.exp(0.5 * (gains - gains.max())) * np.tile(np.gradient(away), len(SPREAD_WIDTHS))
    return float(np.sqrt(weight @ shift**2 / weight.sum()))


def _whitened(
    height: FloatArray,
    low: int,
    high: int,
    profile: SweepHeights,
    noise: Noise,
    drift: int,
    neighbours: tuple[bool, bool],
) -> _Whitened:
    margin = max(4, int((2.0 if drift else 1.0) * FITTED_BESIDE * (high - low)))
    begin = low if neighbours[0] else max(0, low - margin)
    end = high if neighbours[1] else min(len(height), high + margin)
    if end - begin < 5:
        begin, end = max(0, begin - 2), min(len(height), end + 2)
    merge = max(1, (end - begin) // CAP_FIT_BINS)
    count = (end - begin) // merge
    x = (begin + (np.arange(count, dtype=np.float64) + 0.5) * merge - 0.5) * profile.spacing
    values = height[begin : begin + count * merge].reshape(count, merge).mean(axis=1)
    step = merge * profile.spacing
    filter_ = noise.block_filter(count, step, profile.samples * merge)
    basis = np.zeros((count, 0))
    if drift:
        nuisance = ((x - x.mean()) / max(float(np.ptp(x)), step)) ** np.arange(drift)[:, None]
        basis = np.linalg.qr(filter_.whiten(nuisance).T)[0]
    window = _Whitened(x, step, filter_, basis, values)
    return replace(window, values=window.whitened(values))


def _plateau(window: _Whitened, sign: float, low: float, high: float, half: float) -> tuple[float, float, float, float]:
    """(gain, place, half-width, flatness) of the best plateau: its flanks may be a small share of its width."""
    best = _zoom(window, sign, low, high, half, 1.0 - np.geomspace(*FLANKS, 6))
    factor = (FLANKS[1] / FLANKS[0]) ** 0.1
    for _ in range(FLANK_ROUNDS):
        near = 1.0 - (1.0 - best[3]) * np.array([1 / factor, factor])
        best = max(best, _zoom(window, sign, low, high, half, near))
        factor = factor**0.5
    return best


def _zoom(
    window: _Whitened, sign: float, low: float, high: float, half: float, flats: FloatArray
) -> tuple[float, float, float, float]:
    """(gain, place, half-width, flatness) of the best cap: a grid for each flatness (F,), refined around its best
    point."""
    each = np.arange(len(flats))
    narrowest = max(1.2 * window.step, half / 8)
    places = np.tile(np.linspace(low, high, 17), (len(flats), 1))
    widths = np.tile(np.geomspace(narrowest, max(2.0 * half, 1.1 * narrowest), 13), (len(flats), 1))
    best = np.tile([-np.inf, 0.5 * (low + high), half], (len(flats), 1))
    for _ in range(ZOOM_ROUNDS):
        place, width, flat = (
            np.ascontiguousarray(grid).ravel()
            for grid in np.broadcast_arrays(places[:, None, :], widths[:, :, None], flats[:, None, None])
        )
        gains = (sign * window.gains(place, width, flat)[0]).reshape(len(flats), -1)
        top = gains.argmax(axis=1)
        found = np.column_stack(
            [gains[each, top], places[each, top % places.shape[1]], widths[each, top // places.shape[1]]]
        )
        best = np.where(found[:, :1] > best[:, :1], found, best)
        reach = (places[:, 1] - places[:, 0])[:, None] * AROUND
        factor = (widths[:, 1] / widths[:, 0])[:, None] ** AROUND
        places = np.clip(best[:, 1:2] + reach, low, high)
        widths = np.maximum(best[:, 2:] * factor, narrowest)
    k = int(best[:, 0].argmax())
    return (*best[k].tolist(), float(flats[k]))


@dataclass(frozen=True)
class Disturbance:
    """What one stretch of a profile holds.

    Args:
        place: arclength of the crest, or of the plateau's middle, m.
        start, stop: arclengths between which the profile is disturbed, m.
        height: signed height of the crest, m.
        height_sd, place_sd: standard deviations, m.
        half_width: of the fitted cap, m.
        flat: half-length of the flat top, m; 0 for a crest.
        curvature: of the trace at the crest (of the flanks for a plateau), 1/m.
        snr: signal-to-noise ratio.
        unlike_ball: standard deviations by which the data speak for it, against the best that a ball draws; 0 where it
            is as wide as the ball makes it.
    """

    place: float
    start: float
    stop: float
    height: float
    height_sd: float
    place_sd: float
    half_width: float
    flat: float
    curvature: float
    snr: float
    unlike_ball: float = 0.0

    @property
    def felt(self) -> bool:
        """False for what no ball draws, beyond doubt."""
        return self.unlike_ball <= UNSURE

    def highest(self, tip_radius: float, spacing: float) -> float:
        """Height of the highest cap that fits what a ball draws with flanks as wide as these may be, m.

        Infinite from r on: a wall may be of any height.

        Args:
            tip_radius: r, m.
            spacing: of the bins, m: what begins within one is one wider.
        """
        flank = self.half_width - self.flat + UNSURE * self.place_sd + 2.0 * spacing
        if flank >= tip_radius:
            return np.inf
        return (CUSP if self.height < 0 else 1.0) * (tip_radius - float(np.sqrt(tip_radius**2 - flank**2)))

    def at_scale(self, scale: float) -> Disturbance:
        """The same where the noise is that many times what it was taken for."""
        return replace(
            self,
            height_sd=scale * self.height_sd,
            place_sd=scale * self.place_sd,
            snr=self.snr / scale,
            unlike_ball=self.unlike_ball / scale,
        )
