"""Refuted tip: a trace that bends outwards more sharply, at many places, than the ball that is said to have made it.

All that lies under the path of a ball's centre is a union of balls: under each place fits a circle of the ball's
radius that no other place lies in. So three places with the middle one on top lie on a circle no smaller than that. A
smaller one is noise, an outlier, or the trace of a smaller ball. Bends are measured over blocks of 4, 8, 16, ...
samples and held against the scatter of all others; a jump, which bends as far over fewer samples, is an outlier's.

Reference: theory section 4.9.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, length_text
from mapping.base import Base, LaidSweep, LaidTrace
from mapping.instrument import robust_scale

# Chance, at most, that a radius which is right is refuted, whatever body was touched: one log in ten thousand.
REFUTED_BY_CHANCE = 1e-4
# Standard deviations by which a bend may be gentler than it is measured, and the fewest places that refute a radius:
# of 10^5 places of Gaussian noise three exceed that with a chance of (10^5 * 2.9e-7)^3 / 6, 4e-6.
BEND_SDS, FEWEST_BENDS = 5.0, 3
# Standard deviations of its radius by which the ball may be smaller than told: of Gaussian ones 1.3e-3 are. Such a ball
# is refuted only where it is sharp, too: of 150 told too large by a half-normal draw none was.
RADIUS_SDS = 3.0
# Share by which means over blocks bend more than the path: of random pins and plateaus up to 2 r high, 5e-4 to 0.5 r
# between samples, blocks of up to r without noise bend on circles of 0.913 r and more where nothing is steeper than
# LEVEL_ENOUGH (rise over run against the base): up a wall the samples of a table stand far apart.
MEANS_BEND_MORE, LEVEL_ENOUGH = 0.1, 0.5
# Share of a radius below which a bend counts as sharper: along a right-angled groove a ball leans by 45 degrees
# all the way.
LEANT_ALONG = 0.7
# Of the block's size, the least share over which a jump is looked for by its bend alone: a run as long as the block
# bends by half over half of it, which no round crest does over a quarter. Over less noise is as high, and only what is
# so many standard deviations higher is a jump.
SHORTEST_JUMP_SHARE, SURE_JUMP_SDS = 0.25, 3.0
# Half blocks to either side in which a bend has come down to the path beside it: an arc of the height h under a circle
# of the radius c is 2 sqrt(2 c h) wide, and told best over blocks of a third of that.
BESIDE_BLOCKS = 8
# Samples over which the level of the noise is taken: it may change within a sweep, and is known by the median of so
# many to 1.17 / sqrt(256) = 7 %; the fewest bends that tell their scatter, to 18 % by the same, and how many do, to 2
# %.
LEVEL_WINDOW, FEWEST_SCATTERED, SCATTERED = 256, 40, 4000
# Points of the base under a sweep that tell which way is up: on a whole round of a body to 7.5 degrees; and bends that
# are held against each other, each with all.
UP_PLACES, MOST_BENDS = 24, 2000
# Factor between the radii that are tried: the largest is told with two digits.
RADIUS_STEP = 1.02


class _Sought(NamedTuple):
    """What bends are looked for.

    Args:
        jump: power of a share of the distance above whose rise over that share a bend is a jump: of a circle it is 2,
            of a kink 1, of a jump 0.
        block: fewest samples of a block: the smallest share is over one of them.
        either: True if a rise to the other side is a jump, too: beside a reading that dropped out the path bends
            outwards at both shoulders.
    """

    jump: float
    block: int
    either: bool


# A radius is refuted by circles alone; a side by kinks, too, which are sharper the smaller the blocks are
ARCS, KINKS = _Sought(1.0, 4, False), _Sought(0.5, 2, True)


@dataclass(frozen=True)
class RefutedTip:
    """A radius of the tip that the trace refutes.

    Args:
        told: the radius, m.
        largest: the largest radius that the trace allows, m.
        places: where the trace bends more sharply than a ball of the told radius can.
        chance: of so many so sharp ones under the told radius, at most.
    """

    told: float
    largest: float
    places: int
    chance: float

    def record(self) -> dict[str, Any]:
        """JSON values, SI units."""
        return asdict(self) | {"sentence": self.sentence()}

    def sentence(self) -> str:
        """What is wrong, for people."""
        return (
            f"the tip was no ball of {length_text(self.told)}: the trace bends more sharply than such a ball can at "
            f"{self.places} places, and {length_text(self.largest, 2)} is the largest radius that fits"
        )


def refuted_tip(laid: LaidTrace, tip_sd: float = 0.0) -> RefutedTip | None:
    """Hold the radius of the tip against how sharply its trace bends.

    A radius that is too small cannot be refuted: every trace of a ball could be one of a smaller ball.

    Args:
        laid: the trace, outliers included: to a ball that is too large, fine features are such.
        tip_sd: standard deviation of the radius, m.

    Returns:
        What refutes it; None if nothing does.
    """
    smallest = laid.tip_radius - RADIUS_SDS * tip_sd
    bends = _apart(_measured(laid)) if smallest > 0.0 else None
    if bends is None or len(bends.most) < FEWEST_BENDS:
        return None
    chance, places = _by_chance(bends, smallest)
    if chance >= REFUTED_BY_CHANCE:
        return None
    largest = smallest
    while _by_chance(bends, largest)[0] < REFUTED_BY_CHANCE:
        largest /= RADIUS_STEP
    return RefutedTip(laid.tip_radius, largest, places, chance)


def sharp_bends(laid: LaidTrace, side: float) -> int:
    """How many places of the sweeps bend, or have a kink, away from one side of the base, as no ball's path does there.

    What noise makes on two sweeps side by side is two things: each sweep counts.

    Args:
        laid: the trace, outliers included.
        side: 1.0: outwards; -1.0: as outwards would be if the body lay on the other side of the path.
    """
    bends = _apart(_measured(laid, side, KINKS), alone=True)
    return int((bends.most < LEANT_ALONG * laid.tip_radius).sum())


@dataclass(frozen=True, eq=False)
class _Bends:
    """Places where the trace bends outwards, K of them.

    Args:
        at: (K, 3) m.
        reach: (K,) half the length over which each was measured, m.
        least, most: (K,) radii between which that of the bend lies, m.
        height: (K,) by which it stands above the path beside it, at most, m.
        sweep: (K,) number of the sweep.
    """

    at: FloatArray
    reach: FloatArray
    least: FloatArray
    most: FloatArray
    height: FloatArray
    sweep: IntArray

    def select(self, index: IntArray | BoolArray | slice) -> _Bends:
        return _Bends(*(getattr(self, each.name)[index] for each in fields(self)))


_NONE = np.zeros(0)
_NO_BENDS = _Bends(np.zeros((0, 3)), _NONE, _NONE, _NONE, _NONE, np.zeros(0, dtype=np.int64))


def _by_chance(bends: _Bends, radius: float) -> tuple[float, int]:
    """Chance, at most, of bends so sharp under a ball of this radius, and how many are sharper than it can bend.

    A ball that leans to the side by the angle a, against what the sweep passes, turns about it on a circle of r cos a.
    Of slender pins of one height that are passed at any distance, sharper than c r and lower than h above the path
    beside is the share 1 - sqrt((1 - c^2) / (1 - max(0, c - h / r)^2)) at most, whatever their height (theory equation
    4.19); thicker things and other ways to pass them bend less. So the number of sharp ones is a binomial draw at most.
    """
    from scipy.special import betainc

    of = int((bends.least <= radius).sum())
    sharp = bends.select(bends.most < LEANT_ALONG * radius)
    if len(sharp.most) < FEWEST_BENDS:
        return 1.0, len(sharp.most)
    sharp = sharp.select(np.argsort(sharp.most))
    cosine, height = sharp.most / radius, np.maximum.accumulate(sharp.height) / radius
    share = 1.0 - np.sqrt((1.0 - cosine**2) / (1.0 - np.maximum(cosine - height, 0.0) ** 2))
    # each number of the sharpest is asked, and the least chance counts as often as that
    number = np.arange(1, len(share) + 1)
    chances = betainc(number, of - number + 1.0, share)[FEWEST_BENDS - 1 :]
    return float(min(1.0, len(chances) * chances.min())), len(share)


def _apart(bends: _Bends, alone: bool = False) -> _Bends:
    """Of bends that overlap the sharpest: blocks of several sizes, and sweeps side by side, may see one thing.

    Args:
        alone: True to count each sweep's own.
    """
    kept: list[int] = []
    for i in np.argsort(bends.most):
        away = np.linalg.norm(bends.at[kept] - bends.at[i], axis=1)
        other = alone & (bends.sweep[kept] != bends.sweep[i])
        if (other | (away >= np.maximum(bends.reach[kept], bends.reach[i]))).all():
            kept.append(int(i))
    return bends.select(np.array(kept, dtype=np.int64))


class _Path:
    """One sweep as its bends are measured.

    Args:
        sweep: its samples.
        base: tells which way is up.
        side: 1.0; -1.0 if the body lies on the other side of the path than the base says.
    """

    def __init__(self, sweep: LaidSweep, base: Base, side: float = 1.0) -> None:
        centers = sweep.trace.centers
        count = len(centers)
        self.origin, self.number = centers[0], sweep.number
        self.sums = np.zeros((count + 1, 3))
        np.cumsum(centers - self.origin, axis=0, out=self.sums[1:])
        # over many samples, which noise does not lengthen
        many = max(1, count // UP_PLACES)
        self.step = float(np.median(np.linalg.norm(np.diff(centers[::many], axis=0), axis=1))) / many
        knots = np.unique(np.linspace(0, count - 1, min(count, UP_PLACES)).astype(np.int64))
        up = side * base.foot(centers[knots], sweep.trace.tip_radius).normals
        level = np.abs(up - up[0]).max() < np.sqrt(np.finfo(float).eps)
        nearest = np.searchsorted(0.5 * (knots[1:] + knots[:-1]), np.arange(count))
        self.up = np.array(up[:1] if level else up[nearest])  # of one kind for the compiler
        self.scales: list[_Scale] = []
        self.levels = np.zeros(0)

    def __len__(self) -> int:
        return len(self.sums) - 1

    def bent(self, size: int) -> None:
        """Measure the bends over blocks of so many samples, too; their sd but for a factor that all paths share."""
        from mapping.estimate.envelope.bend_kernels import block_bends

        stride = max(1, size // 2)
        rise, product, usable = block_bends(self.sums, self.up, size, stride, self.step, LEVEL_ENOUGH)
        if size == 1:
            self.levels = _levels(rise, np.finfo(float).eps * float(np.abs(self.sums).max()))
        if self.scales:  # of smaller blocks no more is asked than whether a jump is among them
            self.scales[-1].product, self.scales[-1].usable = np.zeros(0), np.zeros(0, dtype=bool)
        self.scales.append(_Scale(size, stride, rise, product, usable, self.levels, len(self)))

    def told(self, radius: float, resolution: float, sought: _Sought) -> _Bends:
        """Bends of the largest blocks that noise cannot have made, nor a jump, and a ball of the radius hardly."""
        scale = self.scales[-1]
        unsure = BEND_SDS * scale.sd + resolution
        surely = scale.rise - unsure
        bent = scale.usable & (surely > 0.0) & (2.0 * radius * (scale.rise + unsure) >= scale.product)
        if not bent.any():
            return _NO_BENDS
        sharp = np.where(bent, surely / np.where(bent, scale.product, 1.0), -np.inf)
        around = np.concatenate([[-np.inf], sharp, [-np.inf]])
        peaks = np.flatnonzero(bent & (sharp >= around[:-2]) & (sharp > around[2:]))
        peaks = peaks[~self._jumps(peaks, sought)]
        product, beside = scale.product[peaks], np.arange(-BESIDE_BLOCKS, BESIDE_BLOCKS + 1)
        at = self._means(peaks)
        path = self._means(np.clip(peaks[:, None] + beside, 0, len(scale.rise) - 1))
        up = self.up if len(self.up) == 1 else self.up[scale.middle(peaks)]
        height = np.einsum("kij,kj->ki", at[:, None] - path, np.broadcast_to(up, at.shape)).max(axis=1, initial=0.0)
        least = 0.5 * product / (scale.rise + unsure)[peaks]
        most = (1.0 + MEANS_BEND_MORE) * 0.5 * product / surely[peaks]
        return _Bends(at + self.origin, np.sqrt(product), least, most, height, np.full(len(peaks), self.number))

    def _means(self, k: IntArray) -> FloatArray:
        """(..., 3) means of the middle blocks of the largest scale's bends k, m, from the first sample on."""
        scale = self.scales[-1]
        begin = k * scale.stride + scale.size
        return np.asarray((self.sums[begin + scale.size] - self.sums[begin]) / scale.size)

    def _jumps(self, peaks: IntArray, sought: _Sought) -> BoolArray:
        """(K,) True where smaller blocks within those of a bend bend as far, as a jump does and no circle.

        Over a share q of the distance a circle rises by q^2, a kink by q, a jump by 1: one is whatever rises by more
        than q to the power of `sought.jump`.
        """
        scale = self.scales[-1]
        jumps = np.zeros(len(peaks), dtype=bool)
        for part in self.scales[:-1]:
            share = part.size / scale.size
            within = np.arange(3 * (scale.size - part.size) // part.stride + 1)
            inside = np.minimum((peaks * scale.stride // part.stride)[:, None] + within, len(part.rise) - 1)
            rise = np.abs(part.rise[inside]) if sought.either else part.rise[inside]
            if share < SHORTEST_JUMP_SHARE:
                rise = rise - SURE_JUMP_SDS * part.sd_of(inside)
            jumps |= rise.max(axis=1) >= share**sought.jump * scale.rise[peaks]
        return jumps


@dataclass(eq=False)
class _Scale:
    """Bends of a sweep of `count` samples over blocks of so many; arrays as in `block_bends`.

    The standard deviation of the first is one of `levels` (L,), m: the sweep in so many equal parts.
    """

    size: int
    stride: int
    rise: FloatArray
    product: FloatArray
    usable: BoolArray
    levels: FloatArray
    count: int

    def sd_of(self, k: IntArray) -> FloatArray:
        """Standard deviations of the heights of bends, m."""
        return np.asarray(self.levels[k * self.stride * len(self.levels) // self.count])

    @property
    def sd(self) -> FloatArray:
        """Of all of them."""
        return self.sd_of(np.arange(len(self.rise)))

    def middle(self, k: IntArray) -> IntArray:
        """Samples in the middle of bends."""
        return np.asarray(k * self.stride + self.size + self.size // 2)


def _measured(laid: LaidTrace, side: float = 1.0, sought: _Sought = ARCS) -> _Bends:
    """Every bend that may be sharper than the tip, over blocks of all sizes."""
    paths = [_Path(sweep, laid.base, side) for sweep in laid.laid_sweeps if len(sweep.trace) > 3]
    return _joined(list(_over_all_sizes(paths, laid.tip_radius, laid.resolution, sought)))


def _over_all_sizes(paths: list[_Path], radius: float, resolution: float, sought: _Sought) -> Iterator[_Bends]:
    size = 1
    while True:
        paths = [path for path in paths if len(path) >= 4 * size]
        for path in paths:
            path.bent(size)
        scales = [path.scales[-1] for path in paths]
        ends = np.cumsum([0, *(len(scale.rise) for scale in scales)])
        if ends[-1] < FEWEST_SCATTERED:
            return
        apart = 1 + int(ends[-1]) // SCATTERED
        some = [np.arange(-begin % apart, len(scale.rise), apart) for begin, scale in zip(ends, scales, strict=False)]
        scattered = [scale.rise[k] / scale.sd_of(k) for k, scale in zip(some, scales, strict=True)]
        scatter = robust_scale(np.concatenate(scattered))
        for path in paths:
            path.scales[-1].levels = scatter * path.scales[-1].levels
            if size >= sought.block:
                yield path.told(radius, resolution, sought)
        size *= 2


def _joined(parts: list[_Bends]) -> _Bends:
    """All together, or every so many-th: those that are too many are alike."""
    columns = ([getattr(each, one.name) for each in (_NO_BENDS, *parts)] for one in fields(_Bends))
    joined = _Bends(*(np.concatenate(column) for column in columns))
    return joined.select(slice(None, None, 1 + len(joined.most) // MOST_BENDS))


def _levels(rise: FloatArray, rounding: float) -> FloatArray:
    """(cells,) usual bend of three samples in equal parts of a sweep, m; what rounding brings to nothing apart."""
    cells = max(1, len(rise) // LEVEL_WINDOW)
    size = len(rise) // cells
    rows = np.sort(np.abs(rise[: cells * size]).reshape(cells, size), axis=1)
    none = np.minimum((rows <= rounding).sum(axis=1), size - 1)
    levels = rows[np.arange(cells), none + (size - none) // 2]
    return np.asarray(np.maximum(levels, max(0.2 * float(np.median(levels)), rounding)))
