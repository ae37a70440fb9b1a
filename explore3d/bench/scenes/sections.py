"""Lines of known cross-section, as a ball feels them: its dilation by brute force, apart from the house's templates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from explore3d.bench.scenes.noise import SAMPLE_SPACING, simulate_noise
from mapping import FloatArray, Trace
from mapping.instrument import Noise

SECTION_TIP = 10e-3
# Finer than any detail of the sections, m: a corner is missed by half of it, its trace by (5e-7)^2 / 2r
SECTION_GRID = 1e-6
# Spacing of the tabled traces, m: what lies between is taken linearly, which is off by (5e-6)^2 / 8r on an arc
TABLED = 5e-6
SWEEP_HALF = 20e-3
SECTION_PITCH = 3e-3
# Every so many samples of the paper's apparatus one is kept: 18 um
EVERY = 3
# How many sweeps cross the line, in turn
SWEEP_COUNTS = (3, 5, 9, 14, 20)
# 0.06 mm of a sample: all of it white, and a third of its variance correlated over 0.3 mm; and what better instruments
# have, white: the less noise there is, the more surely a section that is another is told
SECTION_NOISES = {
    "white": Noise(0.06e-3),
    "OU": Noise(0.049e-3, 0.0346e-3, 0.3e-3),
    "10um": Noise(0.01e-3),
    "2um": Noise(0.002e-3),
}
# Seeds that were looked into while building, and those that are reported; what is built with has sizes of its own, too
FIRST_BUILT_WITH = 1000

Profile = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class SectionBody:
    """A straight line over a plate.

    Args:
        kind: what it is.
        profile: heights of the body over the plate at distances x (N,) from its middle, m.
        half: half of its foot, m.
        height: true height (negative: depth) of the crest, m; where it varies along the line, in the mean.
        widths: least and largest width that is true of it, m: of upright walls one, of skirts from half height to a
            twentieth of it.
        factor: height at the places s (N,) along the line over that of the profile.
        count: how many alike it is.
    """

    kind: str
    profile: Profile
    half: float
    height: float
    widths: tuple[float, float]
    factor: Profile | None = None
    count: int = 1

    @property
    def width_half_way(self) -> float:
        """Its width where it has half of its height, m."""
        x = np.linspace(-self.half, self.half, 2 * int(np.ceil(self.half / SECTION_GRID)) + 1)
        return float(np.ptp(x[self.profile(x) / self.height >= 0.5]))


def _wire(size: float) -> SectionBody:
    a = 0.325e-3 * size
    return SectionBody("ridge", lambda x: a + np.sqrt(np.clip(a**2 - x**2, 0.0, None)), a, 2.0 * a, (2.0 * a, 2.0 * a))


def _trapezoid(kind: str, height: float, top: float, foot: float) -> SectionBody:
    def profile(x: FloatArray) -> FloatArray:
        run = max(0.5 * (foot - top), 1e-12)
        return np.asarray(height * np.clip((0.5 * foot - np.abs(x)) / run, 0.0, 1.0))

    return SectionBody(kind, profile, 0.5 * foot, height, (foot, foot))


def _gaussian(size: float) -> SectionBody:
    height, sd = 0.4e-3 * size, 0.6e-3 * size
    half = 2.0 * sd * np.sqrt(2.0 * np.log(np.array([2.0, 20.0])))
    return SectionBody("ridge", lambda x: height * np.exp(-0.5 * (x / sd) ** 2), 4.0 * sd, height, (half[0], half[1]))


def _cosine(size: float) -> SectionBody:
    height, foot = 0.4e-3 * size, 3e-3 * size
    return SectionBody(
        "ridge",
        lambda x: 0.5 * height * (1.0 + np.cos(2.0 * np.pi * np.clip(x / foot, -0.5, 0.5))),
        0.5 * foot,
        height,
        (0.5 * foot, foot),
    )


def _filleted(size: float) -> SectionBody:
    """A bar with a flat top and quarter circles for its upper edges, and as fillets at its foot."""
    height, fillet, top = 0.4e-3 * size, 0.2e-3 * size, 1.2e-3 * size

    def profile(x: FloatArray) -> FloatArray:
        out = np.abs(x) - 0.5 * top
        upper = height - fillet + np.sqrt(np.clip(fillet**2 - np.clip(out, 0.0, None) ** 2, 0.0, None))
        lower = fillet - np.sqrt(np.clip(fillet**2 - np.clip(2.0 * fillet - out, 0.0, None) ** 2, 0.0, None))
        return np.where(out <= fillet, upper, np.where(out < 2.0 * fillet, lower, 0.0))

    return SectionBody("ridge", profile, 0.5 * top + 2.0 * fillet, height, (top + 2.0 * fillet, top + 4.0 * fillet))


def _burrs(size: float) -> SectionBody:
    """A crack between two burrs: the ball rests on either or on both, and never on what is between, so they are two."""
    height, width, burr = 0.15e-3 * size, 2e-3 * size, 0.3e-3 * size

    def profile(x: FloatArray) -> FloatArray:
        out = np.abs(x) - 0.5 * width
        return np.where(out < 0.0, -1e-3, height * np.clip(1.0 - np.abs(2.0 * out / burr - 1.0), 0.0, 1.0))

    return SectionBody("ridge", profile, 0.5 * width + burr, height, (burr, burr), count=2)


def _bead(size: float) -> SectionBody:
    """A weld bead: a low cap whose height rises and falls along it."""
    height, foot = 0.5e-3 * size, 4e-3 * size
    radius = (0.25 * foot**2 + height**2) / (2.0 * height)

    def profile(x: FloatArray) -> FloatArray:
        return np.clip(np.sqrt(np.clip(radius**2 - x**2, 0.0, None)) - radius + height, 0.0, None)

    return SectionBody(
        "ridge",
        profile,
        0.5 * foot,
        height,
        (foot, foot),
        lambda s: 1.0 + 0.15 * np.sin(2.0 * np.pi * s / 20e-3),
    )


def _taper(size: float) -> SectionBody:
    """A round crest that grows along the line by a twelfth of its height each centimetre."""
    wire = _wire(size)
    return SectionBody("ridge", wire.profile, wire.half, wire.height, wire.widths, lambda s: 1.0 + 8.0 * s)


SECTION_BODIES: dict[str, Callable[[float], SectionBody]] = {
    "wire": _wire,
    "rectangle": lambda size: _trapezoid("ridge", 0.4e-3 * size, 2e-3 * size, 2e-3 * size),
    "triangle": lambda size: _trapezoid("ridge", 0.5e-3 * size, 0.0, 0.8e-3 * size),
    "trapezoid": lambda size: _trapezoid("ridge", 0.4e-3 * size, 1e-3 * size, 2.4e-3 * size),
    "Gaussian": _gaussian,
    "cosine": _cosine,
    "filleted": _filleted,
    "V-scratch": lambda size: _trapezoid("groove", -1e-3 * size, 0.0, 3e-3 * size),
    "rectangular groove": lambda size: _trapezoid("groove", -1e-3 * size, 3e-3 * size, 3e-3 * size),
    "crack with burrs": _burrs,
    "weld bead": _bead,
    "taper": _taper,
}
# Whose family the house has: a remark on these is a false one
TRUE_FAMILIES = ("wire", "rectangle", "triangle", "trapezoid", "rectangular groove")


def section_body(name: str, seed: int) -> SectionBody:
    """The section of a name; seeds from FIRST_BUILT_WITH on have sizes of their own."""
    if seed < FIRST_BUILT_WITH:
        return SECTION_BODIES[name](1.0)
    return SECTION_BODIES[name](float(np.random.default_rng((seed, 1)).uniform(0.8, 1.25)))


def section_trace(name: str, noise: str, seed: int, tip: float = SECTION_TIP) -> Trace:
    """Sweeps of a tip's radius, m, across the line, which lies at any place and slants by up to 20 degrees."""
    body, rng = section_body(name, seed), np.random.default_rng((seed, list(SECTION_BODIES).index(name)))
    count = SWEEP_COUNTS[seed % len(SWEEP_COUNTS)]
    slant, place = rng.uniform(-0.35, 0.35), rng.uniform(-1e-3, 1e-3)
    run = np.arange(-SWEEP_HALF, SWEEP_HALF, SAMPLE_SPACING)
    across = SECTION_PITCH * (np.arange(count) - 0.5 * (count - 1)) * min(1.0, 20e-3 / (SECTION_PITCH * (count - 1)))
    feet = np.column_stack([np.repeat(across, len(run)), np.tile(run, count), np.zeros(len(run) * count)])
    distance = -np.sin(slant) * feet[:, 0] + np.cos(slant) * (feet[:, 1] - place)
    along = np.cos(slant) * feet[:, 0] + np.sin(slant) * (feet[:, 1] - place)
    height = felt(body, distance, along, tip)
    height += simulate_noise(SECTION_NOISES[noise], [run] * count, rng)
    kept = np.tile(np.arange(len(run)) % EVERY == 0, count)
    centers = (feet + (tip + height)[:, None] * [0.0, 0.0, 1.0])[kept]
    sweeps = np.repeat(np.arange(count), len(run))[kept]
    return Trace(2e-4 * np.arange(float(len(centers))), centers, sweeps, tip)


def felt(body: SectionBody, distance: FloatArray, along: FloatArray, tip: float) -> FloatArray:
    """(N,) heights of the ball over the plate's trace, m.

    A height that varies along the line by a slope g is felt as the local section's, to within r g^2 / 2 (2.8 um
    of the weld bead where it is steepest, 0.1 um of the taper).
    """
    if body.factor is None:
        return dilated(body.profile, body.half, distance, tip)
    factor = body.factor(along)
    levels = np.linspace(factor.min(), factor.max(), 25)

    def grown(level: float) -> Profile:
        return lambda x: level * body.profile(x)

    tables = np.array([dilated(grown(float(level)), body.half, distance, tip) for level in levels])
    place = np.clip((factor - levels[0]) / (levels[1] - levels[0]), 0.0, len(levels) - 1.0)
    low = np.minimum(place.astype(np.int64), len(levels) - 2)
    share, number = place - low, np.arange(len(distance))
    return np.asarray((1.0 - share) * tables[low, number] + share * tables[low + 1, number])


def dilated(profile: Profile, half: float, distance: FloatArray, tip: float) -> FloatArray:
    """(N,) heights of a ball over a profile on a plane: the largest over all places that it may touch, m."""
    x = np.linspace(-half, half, 2 * int(np.ceil(half / SECTION_GRID)) + 1)
    z = profile(x)
    z[[0, -1]] = np.maximum(z[[0, -1]], 0.0)  # the plane goes up to the foot
    reach = half + np.sqrt(2.0 * tip * max(float(z.max()), 0.0)) + 2.0 * TABLED
    u = np.arange(-reach, reach, TABLED)
    over = np.where(np.abs(u) >= half, 0.0, -np.inf)
    for part in np.array_split(np.arange(len(x)), max(len(x) // 400, 1)):
        gap = u[:, None] - x[part]
        arcs = z[part] - gap**2 / (tip + np.sqrt(np.clip(tip**2 - gap**2, 0.0, None)))
        over = np.maximum(over, np.where(np.abs(gap) < tip, arcs, -np.inf).max(axis=1))
    return np.interp(distance, u, over, left=0.0, right=0.0)
