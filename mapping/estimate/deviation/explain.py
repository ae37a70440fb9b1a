"""Explain: which causes make what was felt most probable, and the model with them corrected."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Trace
from mapping.base import Base, LaidTrace, Pose
from mapping.estimate.deviation.blocks import (
    BIN,
    BINS_PER_BLOCK,
    SAME_SIDE_COSINE,
    SIDES_APART,
    Blocks,
    weighted_median,
)
from mapping.estimate.deviation.drift import Drift, SteadyDrift, drift
from mapping.estimate.deviation.evidence import LEAST_GAIN, ROUNDING, Fit, Whitened, best_fit, every_law, whitened
from mapping.estimate.deviation.facets import round_out
from mapping.estimate.deviation.fields import RigidFrame, SmoothField, spread
from mapping.estimate.deviation.on_details import unexplained
from mapping.estimate.deviation.parts import DEEP, departure, parts_of
from mapping.estimate.deviation.reshaped import fine_enough, reshaped
from mapping.estimate.deviation.result import Deviation, Part
from mapping.instrument import MAD_TO_SD

# Fewer blocks tell nothing
FEWEST_BLOCKS = 24
# Cells whose median heights say whether anything is wrong, in tip radii; a quantile of their squares, which a fine
# feature in some cells does not move, with its value for unit white noise (of chi-square with one degree of freedom);
# by how much noise that is correlated within a block may exceed that; and the variance of a median over that of a mean,
# of many Gaussian values
CELL, AGREEING_SHARE, AGREEING_SQUARE, AS_EXPECTED, OF_MEDIAN = 2.0, 0.8, 1.642, 4.0, 0.5 * np.pi
# Of a turn at the body's edge, a shift, a scale, an offset, in tip radii: what is expected before anything is felt
EXPECTED_SHARE = 0.1
# Heights without noise scatter so little, in expected departures: its square still counts beside 1 in float64
LEAST_SCATTER = 1e-6
# Lengths of smooth fields: the shortest in tip radii, its bumps being 4.7 of them wide at half height, where the widest
# fine feature is 8; their ratio; the longest as a share of the body
SHORTEST_FIELD, FIELD_RATIO, LONGEST_FIELD = 2.0, 1.5, 1.0
# Amplitudes of smooth fields that are tried, in tip radii
AMPLITUDES = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
# Before anything is felt a model has each of the causes with this probability; and one that moves the surface by less
# than this share of the whole is corrected, but not worth a word
LIKELY_CAUSE, WORTH_NAMING = 0.1, 0.05
# Two explanations that differ by less cannot be told apart
ALIKE_EVIDENCE = float(np.log(10.0))
# Rounds: turns and displacements are linear in the small only
MOST_ROUNDS = 3
# Rounds of least absolute heights, and the share of their scatter below which all weigh the same
ROBUST_ROUNDS, LEAST_ROBUST = 12, 0.3
# Blocks that stand further off the best explanation, in robust standard deviations, do not speak for another
FAR_OFF = 5.0
# More of the felt surface than this that nothing explains, details on it included: the model is another body's. A step
# across the body, which is a fine feature, leaves less than a half of it off the rest.
BEYOND_REPAIR = 0.5
# A ball further off than its own diameter does not touch the place where it would stand: on which side of the body it
# was and over which place, heights alone do not tell. A level so far off is named, and nothing is looked for; tip radii
OWN_DIAMETER = 2.0
# One sample of so many is asked first whether a place was felt: recorded samples lie a thousandth of a tip radius
# apart, so these leave no place of a swept path open, and a tree of all takes a second for 1.4 million
FEW_SAMPLES = 32


@dataclass(frozen=True, eq=False)
class _Explanation:
    """Causes with their sizes.

    The body's are as the columns of RigidFrame, `drift` from the first block to the last, m, `smooth` the coefficients
    of `field`.
    """

    causes: tuple[str, ...]
    instead: tuple[str, ...]
    frame: RigidFrame
    offset: float
    pose: FloatArray
    scale: float
    drift: float
    field: SmoothField | None
    smooth: FloatArray
    gain: float

    def heights(self, blocks: Blocks) -> FloatArray:
        """(B,) that it gives the blocks, m."""
        points, normals = blocks.points, blocks.normals
        rigid = self.frame.pose(points, normals) @ self.pose + self.scale * self.frame.scale(points, normals)[:, 0]
        smooth = 0.0 if self.field is None else self.field.columns(points, normals) @ self.smooth
        return np.asarray(self.offset + rigid + self.drift * _elapsed(blocks)[:, 0] + smooth)


def explain(
    trace: Trace, base: Base, commanded: Sequence[FloatArray] = (), metres: float | None = None
) -> Deviation | None:
    """What is wrong with the model at long wavelengths; None if what was felt agrees with it.

    A mesh whose facets stand for something round is rounded out first (see `round_out`). The heights of blocks of half
    a tip radius over the model are explained by nothing, or by an offset, a pose, a
    scale, an even drift, a smooth deformation, and all of them together, or by a line of each sweep's own: each a
    Gaussian field whose marginal likelihood has a closed form, under noise that is white and correlated along sweeps.
    Blocks beyond a steep place do not count: fine features are what is steep. The most probable explanation is
    corrected, and wide places that still stand off are parts that the model has and the body has not, or the other way
    round.

    Args:
        trace: some sweeps all over the body; a LaidTrace on `base` spares laying it down again.
        base: the model as given or as it was moved.
        commanded: paths (K, 3) of the ball's centre along which the sweeps were to go, m: where one was and nothing was
            felt, the body is not; none: not known.
        metres: length of all sweeps as it was foretold where they were laid out beforehand (see `lay_out`).
    """
    if base.kind != "mesh":
        return None
    given, blocks = base, Blocks.of(LaidTrace.of(trace, base), metres)
    if len(blocks) < FEWEST_BLOCKS:
        return None
    tip, rounded, drawn, over_drawn = trace.tip_radius, round_out(trace, base), base, blocks
    if rounded is not None:
        given = base = rounded.base
        blocks = Blocks.of(LaidTrace.of(trace, base), metres)
    level, level_gain = _common_level(blocks, base, tip)
    if abs(level) > OWN_DIAMETER * tip:
        return _out_of_reach(base, blocks, level, level_gain, tip)
    seen = blocks
    if level:
        base = replace(base, offset=base.offset + level)
        seen = Blocks.of(LaidTrace.of(trace, base))
    missed = base.foot(_unfelt(commanded, trace), tip)
    parts = parts_of(seen, seen.height, seen.smooth_as_felt, tip, missed)
    before, now = base, base
    found: list[_Explanation] = []
    lines: list[Drift | SteadyDrift] = []
    for _ in range(MOST_ROUNDS):
        whole = ~_covered(parts, seen.points)
        keep = seen.smooth_as_felt & whole
        # where more of the surface agrees with the model than hangs together beside it, that is a plateau
        flat = whole & (np.abs(seen.height) <= FAR_OFF * seen.noise)
        plateau = seen.weight[flat].sum() > seen.weight[keep].sum()
        if not _told(seen, keep, tip) or _agrees(seen, seen.height, keep, tip) or plateau:
            break
        step, own = _explanation(seen, whole, base, tip), _drift(seen, whole, tip)
        if own is not None and (step is None or own.gain > step.gain):
            lines.append(own)
            trace = own.without(LaidTrace.of(trace, now))
        elif step is not None:
            found.append(step)
            if not found[1:] and step.field is not None:
                before = fine_enough(before, step.field.length)
                now = before
            now = _corrected(now, step)
            if step.drift:
                lines.append(SteadyDrift.over(seen.t, step.drift))
                trace = lines[-1].without(LaidTrace.of(trace, now))
        else:
            break
        seen = Blocks.of(LaidTrace.of(trace, now))
        parts = parts_of(seen, seen.height, seen.smooth_as_felt, tip, missed)
    deviation = _deviation(before, now, blocks, seen, found, lines, parts, tip)
    if rounded is not None:
        over = drawn.nearest.query(before.surface.vertices)
        deviation = replace(
            deviation,
            causes=("facets", *deviation.causes),
            facets=rounded.bulge,
            gain=deviation.gain or rounded.gain,
            heights=deviation.heights + over.side * over.distance,
            rms=_usual_height(over_drawn),
        )
    elif not found and not lines and not parts and not level and not deviation.beyond_repair:
        return None
    if not level:
        return deviation
    return replace(
        deviation,
        causes=tuple(dict.fromkeys(["offset", *deviation.causes])),
        instead=(),
        offset=now.offset - given.offset,
        heights=deviation.heights + level,
        gain=level_gain,
        facing=_facing(blocks),
    )


def felt_enough(trace: Trace, base: Base) -> bool:
    """True if so much was felt that `explain` could tell that the model is wrong: where it finds nothing, that speaks
    for the model.

    Args:
        trace, base: as given to `explain`.
    """
    blocks, tip = Blocks.of(LaidTrace.of(trace, base)), trace.tip_radius
    if len(blocks) < FEWEST_BLOCKS:
        return False
    keep = blocks.smooth_as_felt
    return _told(blocks, keep, tip) or _agrees(blocks, blocks.height, keep, tip)


def _told(blocks: Blocks, keep: BoolArray, tip: float) -> bool:
    """True if enough of the blocks to keep (B,) lie apart from what is steep: nearer, a height may be the skirt of a
    feature, and says nothing of the model."""
    return bool((keep & blocks.apart(SHORTEST_FIELD * tip)).sum() >= FEWEST_BLOCKS)


def _common_level(blocks: Blocks, base: Base, tip: float) -> tuple[float, float]:
    """How far off the model most of what was felt lies together, m, if as a part of it that would be deep, and the
    logarithm of how much more probable the heights are with it; zeros if it is not. Most of it lies nearer to that
    level than to the model, and no further from it than the other causes reach.

    A tip or a frame that is not as said may be wrong by any amount. What the model expects of its causes,
    EXPECTED_SHARE of a tip radius, is no measure of it: with that prior a level of many tip radii comes out as whatever
    bends enough, and one below the model as a part that is missing everywhere.
    """
    level = weighted_median(blocks.height, blocks.weight)
    within = min(0.5 * abs(level), FAR_OFF * EXPECTED_SHARE * tip)
    near = np.abs(blocks.height - level) <= within
    together = blocks.weight[near].sum() > BEYOND_REPAIR * blocks.weight.sum()
    if abs(level) <= DEEP * tip or not together or near.sum() < FEWEST_BLOCKS:
        return 0.0, 0.0
    if unexplained(blocks, blocks.height, within, tip) <= BEYOND_REPAIR:  # details on the model have that level
        return 0.0, 0.0
    kept = _Kept.of(blocks, near, _rigid_columns(blocks, RigidFrame.of(base.surface)), tip)
    seen, none = kept.whitened(np.zeros((len(kept.height), 0))), np.zeros(0, dtype=np.int64)
    nothing = best_fit(seen, none, np.zeros(0), kept.noise, every_law()).log_evidence
    shifted = best_fit(seen, RIGID["offset"], np.array([abs(level)]), kept.noise, every_law())
    # the width of the prior was chosen for these heights: half a logarithm of their number
    chosen = _before(shifted, 1).log_evidence - 0.5 * float(np.log(len(kept.height)))
    return (level, chosen - nothing) if chosen - nothing >= LEAST_GAIN else (0.0, 0.0)


def _facing(blocks: Blocks) -> FloatArray:
    """(3,) unit direction that the felt side of the model faces; zeros where it faces many."""
    mean = np.average(blocks.normals, axis=0, weights=blocks.weight)
    length = float(np.linalg.norm(mean))
    return np.asarray(mean / length if length > SAME_SIDE_COSINE else np.zeros(3))


def _out_of_reach(base: Base, blocks: Blocks, level: float, gain: float, tip: float) -> Deviation:
    """What was felt lies so far off the model that it is named and nothing else can be said."""
    deviation = _deviation(base, base, blocks, blocks, [], [], (), tip)
    return replace(
        deviation,
        causes=("offset",),
        offset=level,
        heights=deviation.heights + level,
        gain=gain,
        beyond_repair=True,
        facing=_facing(blocks),
    )


def _covered(parts: Sequence[Part], points: FloatArray) -> BoolArray:
    """(N,) True for places (N, 3) that one of the parts takes."""
    return np.asarray(np.any([np.zeros(len(points), dtype=bool), *(part.covers(points) for part in parts)], axis=0))


def _unfelt(commanded: Sequence[FloatArray], trace: Trace) -> FloatArray:
    """(M, 3) places of commanded paths further than a tip radius from all that was felt, m."""
    from scipy.spatial import cKDTree

    spacing, dense = 0.5 * trace.tip_radius, [np.zeros((0, 3))]
    for path in commanded:
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        where = np.arange(0.0, along[-1], spacing)
        dense.append(np.column_stack([np.interp(where, along, path[:, k]) for k in range(3)]))
    places, centers, tip = np.concatenate(dense), trace.centers, trace.tip_radius
    if not len(places):
        return places
    # nearly all places lie beside one of a few samples
    few = centers[::FEW_SAMPLES]
    places = places[~np.isfinite(cKDTree(few).query(places, distance_upper_bound=tip)[0])]
    if not len(places):
        return places
    # the others ask those samples alone whose run of so many could come near one of them
    run = np.arange(len(centers)) // FEW_SAMPLES
    reach = np.maximum.reduceat(np.linalg.norm(centers - few[run], axis=1), FEW_SAMPLES * np.arange(len(few))) + tip
    close = cKDTree(places).query(few, distance_upper_bound=float(reach.max()))[0] <= reach
    distance = cKDTree(centers[close[run]]).query(places, distance_upper_bound=tip)[0]
    return places[~np.isfinite(distance)]


def _agrees(blocks: Blocks, height: FloatArray, keep: BoolArray, tip: float) -> bool:
    """True if the median heights of cells are no larger than noise makes them: a line covers less than half of one."""
    from scipy.spatial import cKDTree

    if keep.sum() < FEWEST_BLOCKS:
        return False
    places = np.column_stack([blocks.points, SIDES_APART * tip * blocks.normals])[keep]
    cell = np.asarray(cKDTree(spread(places, CELL * tip, len(places))).query(places)[1])
    order = np.argsort(cell, kind="stable")
    cells = np.split(order, np.flatnonzero(np.diff(cell[order])) + 1)
    height, weight = height[keep], blocks.weight[keep]
    square = [weight[own].sum() * weighted_median(height[own], weight[own]) ** 2 for own in cells]
    allowed = OF_MEDIAN * AS_EXPECTED * AGREEING_SQUARE * (blocks.noise**2 + (ROUNDING * tip) ** 2)
    return bool(np.quantile(square, AGREEING_SHARE) <= allowed)


def _explanation(blocks: Blocks, whole: BoolArray, base: Base, tip: float) -> _Explanation | None:
    """The most probable causes of the heights of blocks outside of parts (B,), None if none is probable enough."""
    frame = RigidFrame.of(base.surface)
    rigid = _rigid_columns(blocks, frame)
    everything = np.ones(len(blocks), dtype=bool)
    prior = EXPECTED_SHARE * tip
    keep = whole & blocks.smooth(blocks.height - _robust(rigid, blocks.height, blocks.weight, everything, prior))
    if keep.sum() < FEWEST_BLOCKS:
        return None
    fields = _fields(blocks.points[keep], frame, tip)
    flexible = np.column_stack([rigid, *(each.columns(blocks.points, blocks.normals) for each in fields[:1])])
    left = blocks.height - _robust(flexible, blocks.height, blocks.weight, keep, prior)
    keep = _near(left, keep, blocks, tip)
    best = _most_probable(blocks, keep, frame, rigid, fields, tip)
    if best is not None:
        left = blocks.height - best.heights(blocks)
        near = _near(left, keep, blocks, tip)
        if near.sum() < keep.sum():
            best = _most_probable(blocks, near, frame, rigid, fields, tip)
    return best


def _drift(blocks: Blocks, whole: BoolArray, tip: float) -> Drift | None:
    """Lines of the sweeps' own that make the heights of blocks outside of parts (B,) more probable; None if none do."""
    keep = whole & blocks.smooth(blocks.height, drifting=True)
    if keep.any():  # one sweep that stands apart is on a step
        usual = weighted_median(blocks.height[keep], blocks.weight[keep])
        keep = _near(blocks.height - usual, keep, blocks, tip)
    if keep.sum() < FEWEST_BLOCKS:
        return None
    noise, step = max(blocks.noise, ROUNDING * tip), BIN * BINS_PER_BLOCK * tip
    found = drift(blocks.sweep[keep], blocks.place[keep], blocks.height[keep], blocks.weight[keep], noise, step)
    # what stands off the lines does not speak for them
    left = blocks.height - found.at(blocks.sweep, blocks.place)
    near = _near(left, keep, blocks, tip)
    if near.sum() < keep.sum():
        found = drift(blocks.sweep[near], blocks.place[near], blocks.height[near], blocks.weight[near], noise, step)
    return found if found.gain + float(np.log(LIKELY_CAUSE)) >= LEAST_GAIN else None


def _fields(points: FloatArray, frame: RigidFrame, tip: float) -> list[SmoothField]:
    """Smooth fields over places (N, 3), from the shortest length that so many knots tell to the body's size."""
    longest = max(LONGEST_FIELD * 2.0 * frame.length, SHORTEST_FIELD * tip)
    count = 1 + int(np.log(longest / (SHORTEST_FIELD * tip)) / np.log(FIELD_RATIO))
    lengths = SHORTEST_FIELD * tip * FIELD_RATIO ** np.arange(count)
    return [field for field in (SmoothField.over(points, float(length)) for length in lengths) if field is not None]


def _near(left: FloatArray, keep: BoolArray, blocks: Blocks, tip: float) -> BoolArray:
    """(B,) True for blocks to keep whose remaining heights (B,) are no outliers, and that do not lie beside one, on the
    flank of what it is on; for all of them if these are few."""
    from scipy.spatial import cKDTree

    if not keep.any():
        return keep
    sd = max(MAD_TO_SD * weighted_median(np.abs(left[keep]), blocks.weight[keep]), blocks.noise)
    near = keep & (np.abs(left) <= FAR_OFF * sd)
    if (far := keep & ~near).any():
        near &= cKDTree(blocks.points[far]).query(blocks.points)[0] > BIN * BINS_PER_BLOCK * tip
    return near if near.sum() >= FEWEST_BLOCKS else keep


def _robust(columns: FloatArray, height: FloatArray, weight: FloatArray, keep: BoolArray, prior: float) -> FloatArray:
    """(B,) heights of the columns (B, K) that leave the least absolute heights, weighed, of the blocks to keep."""
    a, y, weight = columns[keep], height[keep], weight[keep]
    found = np.zeros(columns.shape[1])
    for _ in range(ROBUST_ROUNDS):
        left = np.abs(y - a @ found)
        sd = max(MAD_TO_SD * weighted_median(left, weight), LEAST_SCATTER * prior)
        weighted = a * (weight / np.maximum(left / sd, LEAST_ROBUST))[:, None]
        found[:] = np.linalg.solve(weighted.T @ a + np.eye(a.shape[1]) * (sd / prior) ** 2, weighted.T @ y)
    return np.asarray(columns @ found)


def _elapsed(blocks: Blocks) -> FloatArray:
    """(B, 1) share of the recording's time that had passed when each was felt."""
    whole = max(float(np.ptp(blocks.t)), np.finfo(float).tiny)
    return np.asarray((blocks.t - blocks.t.min()) / whole)[:, None]


def _rigid_columns(blocks: Blocks, frame: RigidFrame) -> FloatArray:
    """(B, 9) heights of a unit of each of the causes that do not bend the body (see RIGID)."""
    causes = (frame.offset, frame.pose, frame.scale)
    return np.column_stack([*(make(blocks.points, blocks.normals) for make in causes), _elapsed(blocks)])


# Columns of the causes that do not bend the body
RIGID = {"offset": np.arange(1), "pose": np.arange(1, 7), "scale": np.arange(7, 8), "drift": np.arange(8, 9)}


def _rigid_sets() -> Iterator[tuple[str, ...]]:
    names = tuple(RIGID)
    return chain.from_iterable(combinations(names, count) for count in range(len(names) + 1))


@dataclass(frozen=True, eq=False)
class _Kept:
    """The blocks that speak for a cause, with the columns (B, 9) of the rigid ones."""

    height: FloatArray
    points: FloatArray
    normals: FloatArray
    piece: IntArray
    place: FloatArray
    weight: FloatArray
    rigid: FloatArray
    noise: float
    tip: float

    @classmethod
    def of(cls, blocks: Blocks, keep: BoolArray, rigid: FloatArray, tip: float) -> _Kept:
        height, points, normals = blocks.height[keep], blocks.points[keep], blocks.normals[keep]
        piece, place, noise = blocks.piece[keep], blocks.place[keep], max(blocks.noise, ROUNDING * tip)
        return cls(height, points, normals, piece, place, blocks.weight[keep], rigid[keep], noise, tip)

    def whitened(self, smooth: FloatArray) -> list[Whitened]:
        """Heights, rigid columns and those of a smooth field (B, J) under each law of noise."""
        columns = np.column_stack([self.height, self.rigid, smooth])
        return whitened(columns, self.piece, self.place, self.weight, BIN * BINS_PER_BLOCK * self.tip)

    def rigid_fits(self) -> dict[tuple[str, ...], Fit]:
        """One for every set of rigid causes."""
        seen, fits = self.whitened(np.zeros((len(self.height), 0))), {}
        for names in _rigid_sets():
            which = np.concatenate([np.zeros(0, dtype=np.int64), *(RIGID[name] for name in names)])
            fit = best_fit(seen, which, np.full(len(which), EXPECTED_SHARE * self.tip), self.noise, every_law())
            fits[names] = _before(fit, len(names))
        return fits

    def bent_fit(self, field: SmoothField) -> tuple[tuple[str, ...], Fit]:
        """The best one of a smooth field with some rigid causes, and their names."""
        smooth = field.columns(self.points, self.normals)
        seen = self.whitened(smooth)
        bending = np.arange(self.rigid.shape[1], self.rigid.shape[1] + smooth.shape[1])
        found: list[tuple[tuple[str, ...], Fit]] = []
        for names in ((), ("pose",), tuple(RIGID)):
            which = np.concatenate([*(RIGID[name] for name in names), bending])
            rigid = np.full(len(which) - len(bending), EXPECTED_SHARE * self.tip)
            priors = [np.append(rigid, np.full(len(bending), amplitude * self.tip)) for amplitude in AMPLITUDES]
            law = best_fit(seen, which, priors[len(priors) // 2], self.noise, every_law()).law
            fits = [best_fit(seen, which, prior, self.noise, [law]) for prior in priors]
            best = max(fits, key=lambda fit: fit.log_evidence)
            # its amplitude and its length were chosen for these heights: half a logarithm of their number each
            chosen = replace(best, log_evidence=best.log_evidence - float(np.log(len(self.height))))
            found.append((names, _before(chosen, len(names) + 1)))
        return max(found, key=lambda each: each[1].log_evidence)


def _before(fit: Fit, causes: int) -> Fit:
    """The fit with the prior odds of so many causes."""
    return replace(fit, log_evidence=fit.log_evidence + causes * float(np.log(LIKELY_CAUSE)))


def _most_probable(
    blocks: Blocks, keep: BoolArray, frame: RigidFrame, rigid: FloatArray, fields: list[SmoothField], tip: float
) -> _Explanation | None:
    """The explanation of the kept blocks with the highest evidence, None if it is that there is nothing."""
    kept = _Kept.of(blocks, keep, rigid, tip)
    fits = kept.rigid_fits()
    nothing = fits[()].log_evidence
    best = max(fits, key=lambda names: fits[names].log_evidence)
    found = replace(_of_fit(best, fits[best], frame, nothing), instead=_instead(best, fits))
    left = blocks.height - found.heights(blocks)
    if not _agrees(blocks, left, keep, tip):
        for field in fields:
            bent = _of_fit(*kept.bent_fit(field), frame, nothing, field)
            found = bent if bent.gain > found.gain else found
    return _ordered(found, kept) if found.gain >= LEAST_GAIN else None


def _instead(best: tuple[str, ...], fits: dict[tuple[str, ...], Fit]) -> tuple[str, ...]:
    """As many other causes that explain the heights as well."""
    enough = fits[best].log_evidence - ALIKE_EVIDENCE
    other = [names for names in fits if len(names) == len(best) and names != best]
    return tuple(" and ".join(names) for names in other if fits[names].log_evidence > enough)


def _of_fit(
    names: tuple[str, ...], fit: Fit, frame: RigidFrame, nothing: float, field: SmoothField | None = None
) -> _Explanation:
    """What a fit of rigid causes, and of a smooth field after them, says."""
    which = np.concatenate([np.zeros(0, dtype=np.int64), *(RIGID[name] for name in names)])
    values = np.zeros(9)
    values[which] = fit.coefficients[: len(which)]
    return _Explanation(
        causes=names if field is None else (*names, "deformation"),
        instead=(),
        frame=frame,
        offset=float(values[0]),
        pose=values[1:7],
        scale=float(values[7]),
        drift=float(values[8]),
        field=field,
        smooth=fit.coefficients[len(which) :],
        gain=fit.log_evidence - nothing,
    )


def _ordered(found: _Explanation, kept: _Kept) -> _Explanation:
    """With the cause that moves the surface most first, without those that hardly move it."""
    points, normals, frame = kept.points, kept.normals, found.frame
    alone = {
        "offset": np.full(len(points), found.offset),
        "pose": frame.pose(points, normals) @ found.pose,
        "scale": found.scale * frame.scale(points, normals)[:, 0],
        "drift": found.drift * kept.rigid[:, RIGID["drift"][0]],
        "deformation": 0.0 if found.field is None else found.field.columns(points, normals) @ found.smooth,
    }
    size = {cause: float(np.sqrt(np.mean(np.square(alone[cause])))) for cause in found.causes}
    causes = sorted(found.causes, key=lambda cause: -size[cause])
    named = tuple(cause for cause in causes if size[cause] >= WORTH_NAMING * size[causes[0]])
    return replace(found, causes=named, instead=found.instead if len(named) == len(causes) else ())


def _corrected(base: Base, step: _Explanation) -> Base:
    """The model with the causes applied: bent and scaled first, then moved."""
    frame = step.frame
    if step.field is not None or step.scale:
        vertices = base.surface.vertices
        moved = vertices + step.scale / frame.length * (vertices - frame.middle)
        if step.field is not None:
            moved = moved + step.field.displaced(vertices, step.smooth)
        base = reshaped(base, moved)
    if step.pose.any():
        turn, shift = step.pose[:3] / frame.length, step.pose[3:]
        rotation = Pose.turned(turn)
        translation = frame.middle - rotation @ frame.middle + shift
        base = Pose(rotation, translation, frame.middle, np.zeros((6, 6))).moved(base)
    return replace(base, offset=base.offset + step.offset) if step.offset else base


def _deviation(
    before: Base,
    now: Base,
    blocks: Blocks,
    seen: Blocks,
    found: list[_Explanation],
    lines: list[Drift | SteadyDrift],
    parts: tuple[Part, ...],
    tip: float,
) -> Deviation:
    """What all rounds and the parts come to."""
    of_body = [step.causes for step in found if step.causes != ("drift",)]
    named = dict.fromkeys(
        [*(of_body[0] if of_body else ()), *(["drift"] if lines else []), *(["part"] if parts else [])]
    )
    vertices = before.surface.vertices
    heights = ((now.surface.vertices - vertices) * _vertex_normals(before)).sum(axis=1) + now.offset - before.offset
    for part in parts:
        if np.isfinite(part.height):
            heights[part.covers(now.surface.vertices)] += part.height
    keep = seen.smooth_as_felt
    left_over = unexplained(seen, seen.height, departure(seen.noise, tip), tip)
    middle = RigidFrame.of(before.surface).middle
    old, new = Pose.of(before), Pose.of(now)
    shift, turn = np.zeros(3), 0.0
    if new is not None and any(step.pose.any() for step in found):
        back = np.eye(3) if old is None else old.rotation
        there = new.onto((middle if old is None else old.back(middle[None])[0])[None])[0]
        shift, turn = there - middle, Pose.angle(new.rotation @ back.T)
    bends = [step for step in found if step.field is not None]
    bent = sum(step.field.columns(blocks.points, blocks.normals) @ step.smooth for step in bends if step.field)
    return Deviation(
        base=now,
        causes=tuple(named),
        instead=found[0].instead if found else (),
        shift=shift,
        turn=turn,
        scale=float(np.prod([1.0 + step.scale / step.frame.length for step in found])),
        offset=now.offset - before.offset,
        bent=float(np.abs(bent).max()) if bends else 0.0,
        length=bends[0].field.length if bends and bends[0].field else 0.0,
        lines=tuple(lines),
        parts=parts,
        rms=_usual_height(blocks),
        left=MAD_TO_SD * float(np.median(np.abs(seen.height[keep]))),
        gain=(*(step.gain for step in found), *(own.gain for own in lines if isinstance(own, Drift)), 0.0)[0],
        heights=heights,
        unexplained=left_over,
        beyond_repair=left_over > BEYOND_REPAIR,
    )


def _usual_height(blocks: Blocks) -> float:
    """Of the blocks where a smooth surface joins them, by their median, m."""
    return MAD_TO_SD * float(np.median(np.abs(blocks.height[blocks.smooth_as_felt])))


def _vertex_normals(base: Base) -> FloatArray:
    """(V, 3) unit normals at the vertices, the faces' weighted by their areas."""
    surface = base.surface
    weighted = surface.face_normals * surface.face_areas[:, None]
    normals = np.zeros((len(surface.vertices), 3))
    for corner in range(3):
        np.add.at(normals, surface.faces[:, corner], weighted)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(np.divide(normals, length, out=np.zeros_like(normals), where=length > 0))
