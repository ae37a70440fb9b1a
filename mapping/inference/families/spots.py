"""The posteriors of point features: bumps and pits."""

from __future__ import annotations

import numpy as np

from mapping import Feature, FloatArray
from mapping.inference.families.bell import bell_shape
from mapping.inference.families.bump import BumpShape, Spot, spot_at
from mapping.inference.families.hollow import PitShape
from mapping.inference.families.problem import PosteriorProblem, Sizes, Surroundings, pose, sizes_of, window_for
from mapping.inference.likelihood import Prior, Shape, StudentT, Uniform, Window

# A position across the sweeps is asked for only if they spread over this share of the disturbance.
SPREAD = 0.1
# Prior of log radius: a ball lying on the base (a = H/2) unless the data say otherwise, with heavy tails.
RADIUS_SCALE = 1.0


def spot_problem(feature: Feature, around: Surroundings, *, bell: bool = False) -> PosteriorProblem:
    """Pose the posterior of a bump (a cap, or with `bell` a bump with a skirt) or a pit."""
    tip = around.trace.tip_radius
    sizes = sizes_of(feature, tip)
    point, normal = feature.axis[:1], feature.normals[:1]
    window = window_for(point + tip * normal, sizes, around)
    middle = int(np.argmin(np.linalg.norm(window.feet - point, axis=1)))
    spot = spot_at(point[0], normal[0], window.tangents[middle], around.base, tip, sizes.half_width)
    free = 2 if np.ptp((window.feet - spot.point) @ spot.axes[1]) > SPREAD * sizes.half_width else 1
    if bell:
        form: Shape = bell_shape(window, spot, sizes, tip, free, place_prior(sizes), height_prior(sizes))
        return pose(feature, sizes, form, window, around, _bell_beginnings(form.start))
    shape: Shape = (bump_shape if feature.kind == "bump" else pit_shape)(window, spot, sizes, tip, free)
    return pose(feature, sizes, shape, window, around, _beginnings(shape.start, free, sizes, feature.kind))


def bump_shape(window: Window, spot: Spot, sizes: Sizes, tip: float, free: int) -> BumpShape:
    """Bumps about a spot: position within 1.5 half widths, any height up to several times the detected one."""
    place = place_prior(sizes)
    priors = (*(place,) * free, height_prior(sizes), radius_prior(sizes, tip))
    start = np.array([0.0] * free + [sizes.height, np.log(sizes.radius)])
    step = np.array([0.02 * sizes.half_width] * free + [0.02 * sizes.height, 0.1])
    return BumpShape(window, spot, tip, free, priors, start, step)


def pit_shape(window: Window, spot: Spot, sizes: Sizes, tip: float, free: int) -> PitShape:
    """Pits about a spot: log width and log depth equally probable over wide ranges."""
    place = place_prior(sizes)
    width, depth = hollow_priors(sizes, tip)
    start = np.array([0.0] * free + [np.log(2.0 * sizes.radius), np.log(2.0 * sizes.height)])
    step = np.array([0.02 * sizes.half_width] * free + [0.02, 0.05])
    return PitShape(window, spot, tip, free, (*(place,) * free, width, depth), start, step)


def place_prior(sizes: Sizes) -> Prior:
    """Anywhere within 1.5 half widths of where it was detected."""
    return Uniform(-1.5 * sizes.half_width, 1.5 * sizes.half_width)


def height_prior(sizes: Sizes) -> Prior:
    """Equally probable from nothing to several times what was detected."""
    return Uniform(0.0, max(4.0 * sizes.height, sizes.height + 10.0 * sizes.height_sd))


def radius_prior(sizes: Sizes, tip: float) -> Prior:
    """Log radius: about a round wire or ball lying on the base, a = H/2.

    Under a much larger tip only radius + tip counts, and the data hardly determine the radius: the prior does, within
    a factor of e or so. Its tails are heavy: a gentle cap of a thousand times that radius is found where the trace
    shows it.
    """
    guess = float(np.log(0.5 * sizes.height))
    return StudentT(guess, RADIUS_SCALE, 4.0, guess - 7.0, float(np.log(1e4 * max(tip, sizes.height, sizes.radius))))


def hollow_priors(sizes: Sizes, tip: float) -> tuple[Prior, Prior]:
    """Log width and log depth of a groove or pit; the ball does not feel the bottom of a deep one."""
    width = np.log(2.0 * sizes.radius)
    depth = np.log(sizes.height)
    return Uniform(width - 2.0, width + 2.0), Uniform(depth - 1.5, float(max(np.log(tip), depth + 2.0)))


def _beginnings(start: FloatArray, free: int, sizes: Sizes, kind: str) -> FloatArray:
    """Starts that differ in place and in what the first guess knows least."""
    starts = [start]
    for shift in (-0.5, 0.5):
        moved = start.copy()
        moved[0] += shift * sizes.half_width
        starts.append(moved)
    others = (4.0 * sizes.radius, 0.5 * sizes.height) if kind == "bump" else (sizes.height,)
    for size in others:
        other = start.copy()
        other[free + 1] = np.log(size)
        starts.append(other)
    return np.array(starts)


def _bell_beginnings(start: FloatArray) -> FloatArray:
    """Starts from slender to wide, with a long skirt and with none."""
    starts = []
    for scale in (-1.5, -0.5, 0.5):
        for exponent in (0.0, 2.0):
            other = start.copy()
            other[-2:] = start[-2] + scale, exponent
            starts.append(other)
    return np.array(starts)
