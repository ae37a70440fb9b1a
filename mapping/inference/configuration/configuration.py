"""Configuration: some features of one neighbourhood together, fitted, with their log odds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from mapping import Feature, FloatArray, Interval, MappingError
from mapping.geometry.mesh import distances
from mapping.geometry.templates import crest_trace, untouched_run
from mapping.inference.configuration.common_deviation import Deviation, Fitted, common_deviation
from mapping.inference.configuration.neighbourhood import NEIGHBOURHOOD_REACH, PARTS_OF_BIN, Neighbourhood
from mapping.inference.curves import HIGHEST_DEGREE
from mapping.inference.families import (
    GrooveShape,
    RidgeShape,
    StepShape,
    TwinShape,
    bell_beside,
    bell_ridge_beside,
    frustum_beside,
    slanted_beginnings,
    slanted_beside,
    smooth_beginnings,
    smooth_groove_beside,
    trapezoid_beside,
    twin_beside,
)
from mapping.inference.joint import JoinedShape, stands_out
from mapping.inference.kinds import UPRIGHT_RUN, LineKind, PointKind, kind_of, sizes_of
from mapping.inference.likelihood import LogPosterior, Shape
from mapping.inference.sampler import ITERATIONS, LEARNING, Laplace, find_optima, laplace

# Standard deviations of chi-square by which a residual may exceed the noise where nothing is left to explain
FITTING_EXCESS = 3.0
# A line wider than a wire by less is as narrow as one: 2 % of wires are not
WIDE_SDS = 2.0
# Signal-to-noise ratio of the gap of two lines that are two: of one in 40 flat tops noise makes as much of a gap
SINKS_SDS = 2.0
# Standard deviations by which a place must stand off a configuration to be looked at; how wrong one is, is then asked
# of the evidence
PEAK_SDS = 4.0
# Half-width of the crests that a residual is searched with, in that of the narrowest detail: where one is hidden in
# another's disturbance only a part of it stands out
SHARPEST = 0.7
# Iterations after which a configuration is given up if it is still less likely than another by this log odds, beside
# what fewer parameters spare: one course of 7 instead of two pieces of 21 is likelier by 10 with a density that is less
# by 71 (double_ring of building seed 3)
SCREENED, HOPELESS = 8, 40.0
# Half-widths within which the priors of the kinds leave a place open
PLACE_OPEN = 1.5
# Lower is no height, m: its inverse squared is still a number
NO_HEIGHT = 1e-12
# The level of misfit is chosen again where the optimum under the first one says another
MOST_LEVEL_CHANGES = 3
# Share of its height that is felt of a crest which is proposed: between two rows as far apart as its half-width it is
# felt by three quarters, 1 - (1/2)^2
FELT_TOP = 0.5
# Half-widths beside the axis of a groove within which the ball is about as deep as on it: where it hangs between two
# rims it is 1 - (1 - 0.25)^2 = 0.44 of the depth higher at the border of that, 0.23 in the median
ON_AXIS = 0.25


@dataclass(frozen=True, eq=False)
class Part:
    """One detail of a configuration.

    Args:
        feature: what it is called, and where it was proposed.
        shape: its family over the neighbourhood.
        start: (P,) parameters that the search begins from.
    """

    feature: Feature
    shape: Shape
    start: FloatArray

    @property
    def kinds(self) -> tuple[str, ...]:
        """The features that it consists of: a twin of two."""
        return (self.feature.kind,) * (2 if isinstance(self.shape, TwinShape) else 1)


@dataclass(frozen=True, eq=False)
class Configuration:
    """Fitted parts.

    Args:
        parts: the details, each of which begins where it was found.
        place: the neighbourhood.
        found: the optimum of all their parameters together, and the Gaussian there.
        level: number of the most likely one of the levels of misfit.
        log_odds: log of evidence times prior, up to one constant of the neighbourhood.
        deviation: what all crossings of a detail show alike beyond its family.
    """

    parts: tuple[Part, ...]
    place: Neighbourhood
    found: Laplace
    level: int
    log_odds: float
    deviation: Deviation

    @property
    def kinds(self) -> tuple[str, ...]:
        """The features that it consists of."""
        standing = zip(self.parts, self.stands, strict=True)
        return tuple(sorted(kind for part, stands in standing if stands for kind in part.kinds))

    @cached_property
    def stands(self) -> list[bool]:
        """Of each part whether it is a detail of its own: not a crest that only bounds the hollow beside it.

        The ball that sinks into a hollow rests on the crests at its rims however low they are. Standing on the bare
        base a crest explains half of its signal-to-noise ratio squared at most; where that does not pay for one detail
        more, what it gains beyond it gains as a part of the hollow's section.
        """
        if not any(_is_hollow(part) for part in self.parts):
            return [True] * len(self.parts)
        strengths = [self.strength(k) for k in range(len(self.parts))]
        return [
            not stands_out(part.shape) or 0.5 * strength**2 > -_log_prior(part, self.place)
            for part, strength in zip(self.parts, strengths, strict=True)
        ]

    @property
    def tops_are_felt(self) -> bool:
        """True if every crest is at most so high that half of it was felt: what the base may do under each run stands
        for most of a ball of any size, and what it leaves of that follows any slope."""
        crests = [part for part in self.parts if stands_out(part.shape)]
        highest = max((part.start[part.shape.names.index("height")] for part in crests), default=0.0)
        return bool(np.ptp(self.place.window.height) >= FELT_TOP * highest)

    def strength(self, k: int) -> float:
        """Signal-to-noise ratio of the k-th part alone, over the bare base.

        A crest's is of its height alone: one of none stands out of a base that bends away from under it, as at an edge.
        """
        part = self.parts[k]
        alone = JoinedShape([part.shape], len(self.place.window), PARTS_OF_BIN)
        template = alone.templates(part.start[None])
        if stands_out(part.shape):
            none = part.start.copy()
            none[part.shape.names.index("height")] = 0.0
            template = template - alone.templates(none[None])
        white = self.place.levels[0][0].filter.whiten(template)[0]
        return float(np.sqrt(white @ white))

    def hopeless(self, parameters: int, level: int) -> float:
        """The log likelihood under one of the levels of misfit below which others of so many parameters are hopeless.

        Of fewer each is taken to spare what one of these costs, of the likelihood at their best.
        """
        own, constant = self.place.levels[self.level]
        best, there = (float(each.log_density(self.template[None])[0]) for each in (own, self.place.levels[level][0]))
        cost = max(best + constant - float(np.log(len(self.place.levels))) - self.log_odds, 0.0)
        return there - cost * max(1.0 - parameters / max(len(self.found.mean), 1), 0.0) - HOPELESS

    @cached_property
    def shape(self) -> JoinedShape:
        """All parts joined."""
        return self.place.joined([part.shape for part in self.parts])

    @cached_property
    def template(self) -> FloatArray:
        """(n,) heights that it leaves, m."""
        return np.asarray(self.shape.templates(self.found.mean[None])[0])

    @cached_property
    def crests(self) -> FloatArray:
        """(n,) heights of its crests over the ground that they stand on, m."""
        crests = [part for part in self.parts if stands_out(part.shape)]
        theta = np.concatenate([np.zeros(0), *(part.start for part in crests)])
        joined = JoinedShape([part.shape for part in crests], len(self.place.window), PARTS_OF_BIN)
        return np.asarray(joined.templates(theta[None])[0])

    def runs(self, k: int) -> int:
        """How many runs of a sweep felt the k-th part at half its height or more."""
        part, window = self.parts[k], self.place.window
        own = np.abs(JoinedShape([part.shape], len(window), PARTS_OF_BIN).templates(part.start[None])[0])
        return int((np.maximum.reduceat(own, window.starts[:-1]) > 0.5 * own.max()).sum())

    @property
    def fits(self) -> bool:
        """True if what it leaves over is no more than noise, the least misfit, and what all crossings show alike."""
        white = self.white_residual
        return (float(white @ white) - self.deviation.explained - len(white)) / float(
            np.sqrt(2.0 * len(white))
        ) < FITTING_EXCESS

    @property
    def is_explained(self) -> bool:
        """True if the least misfit is likeliest, and nothing stands off it."""
        return self.level == 0 and not bool((np.abs(self.standing_off) > PEAK_SDS).any())

    @cached_property
    def white_residual(self) -> FloatArray:
        """What it leaves over, in standard deviations of the noise and the least misfit."""
        return np.asarray(self.place.levels[0][0].residuals(self.template[None])[0])

    @property
    def log_prior(self) -> float:
        """Log odds of its details before the data."""
        return sum(_log_prior(part, self.place) for part in self.parts)

    @property
    def log_probability(self) -> float:
        """Its log odds where details are as frequent as the log shows elsewhere."""
        return self.log_odds + self.place.log_company(len(self.parts))

    @cached_property
    def as_narrow_as_wires(self) -> list[bool]:
        """Of each part whether it is a ridge as narrow as a wire of its height that lies on the base, within doubt."""
        narrow = []
        for part, own in zip(self.parts, self.shape.columns, strict=True):
            is_round = isinstance(part.shape, RidgeShape)
            narrow.append(is_round and _beyond_wire(part, self.found.covariance[own, own]) < WIDE_SDS)
        return narrow

    @cached_property
    def residual(self) -> FloatArray:
        """(n,) heights that it leaves over, without what the base may do under each run, m."""
        window = self.place.window
        over = window.height - self.template
        for start, stop in zip(window.starts[:-1], window.starts[1:], strict=True):
            over[start:stop] -= np.median(over[start:stop])
        return np.asarray(over)

    @property
    def felt(self) -> FloatArray:
        """(n,) heights without what the base may do under each run, m."""
        return self.template + self.residual

    @cached_property
    def standing_off(self) -> FloatArray:
        """(n,) standard deviations by which a thin crest at each place would stand out of it along its run."""
        window, half = self.place.window, SHARPEST * self.place.half_width
        spacing = 2.0 * float(window.half[0])
        reach = max(int(half / spacing), 0)
        crest = crest_trace(np.abs(np.arange(-reach, reach + 1) * spacing), 1.0, half)
        weight = self.place.levels[0][0].filter.scale ** 2
        off = np.zeros(len(window))
        for start, stop in zip(window.starts[:-1], window.starts[1:], strict=True):
            own = slice(start, stop)
            found = np.convolve(weight[own] * self.residual[own], crest, "full")[reach : reach + stop - start]
            square = np.convolve(weight[own], crest**2, "full")[reach : reach + stop - start]
            off[own] = found / np.sqrt(np.maximum(square, np.finfo(float).tiny))
        return off


def part_of(feature: Feature, place: Neighbourhood, most: int = HIGHEST_DEGREE, least: int = 1) -> Part:
    """The part of a feature, in the first family of its kind.

    Args:
        feature: of a kind with a posterior.
        place: the neighbourhood.
        most, least: degrees that the course of a line may have.
    """
    kind = kind_of(feature)
    if isinstance(kind, LineKind):
        line, _ = kind.shape_on(place.fine, feature, place.around, most, least)
        return Part(feature, line, line.start)
    if not isinstance(kind, PointKind):
        raise TypeError(f"a {feature.kind} has no family of shapes")
    spot = kind.shape_on(place.fine, feature, place.around)
    return Part(feature, spot, spot.start)


def about(height: float) -> Interval:
    """What a height (m) is taken to be that is only proposed: within a fifth of it."""
    low, high = sorted((0.8 * height, 1.2 * height))
    return Interval(height, low, high)


def on_its_floor(part: Part, place: Neighbourhood) -> Part:
    """An upright groove as deep and wide as one on whose floor the ball runs, if that is likelier to begin with.

    From its depth alone a groove is taken to be as wide as a ball hangs in it that sinks so far. A wider one is never
    found from there: while the ball hangs the path says nothing of the depth. Half as deep as on its axis the ball is
    sqrt(r H - H^2 / 4) inside a rim (paper equation 4).
    """
    groove, feature, tip = part.shape, part.feature, place.around.trace.tip_radius
    if type(groove) is not GrooveShape:
        return part
    window, sizes = place.window, sizes_of(feature, tip)
    s, lateral, _ = groove.chart.coordinates(window.feet)
    aside = np.abs(lateral - groove.modes.lateral(part.start[None, : groove.modes.count], s)[0])
    near = (aside < NEIGHBOURHOOD_REACH * sizes.half_width) & (s > groove.chart.s[0]) & (s < groove.chart.s[-1])
    middle = near & (aside < ON_AXIS * sizes.half_width)
    depth = -float(np.median(window.height[middle])) if middle.any() else 0.0
    if not 0.0 < depth < 2.0 * tip:
        return part
    deep = near & (window.height < -0.5 * depth)
    width = 2.0 * (float(aside[deep].max(initial=0.0)) + float(np.sqrt(tip * depth - 0.25 * depth**2)))
    felt = replace(feature, height=about(-depth), width=Interval(width, 0.5 * width, 2.0 * width))
    try:
        wide = part_of(felt, place)
    except MappingError:  # the base does not go on so far beside its axis: it stays as it was told
        return part
    wide = replace(wide, start=np.array([*wide.start[:-2], np.log(width), np.log(depth)]))
    log = [
        float(LogPosterior(place.joined([each.shape]), place.levels[-1][0]).log_density(each.start[None])[0])
        for each in (part, wide)
    ]
    return wide if log[1] > log[0] else part


def as_bar(part: Part, place: Neighbourhood, top: float, run: float | None = None) -> Part:
    """A ridge with a flat top of a width (m) and flanks that climb over a run (m), or upright ones."""
    ridge: Any = part.shape
    bar = trapezoid_beside(ridge, sizes_of(part.feature, ridge.tip_radius), roof=False)
    return Part(part.feature, bar, np.concatenate([part.start[:-1], np.log([top, run or _upright(place)])]))


def as_frustum(part: Part, place: Neighbourhood, top: float, run: float | None = None) -> Part:
    """A round bump with a flat top of a width (m) and a flank that climbs over a run (m), or an upright one."""
    cap: Any = part.shape
    frustum = frustum_beside(cap, sizes_of(part.feature, cap.tip_radius), roof=False)
    return Part(part.feature, frustum, np.append(part.start[:-1], np.log([top, run or _upright(place)])))


def _upright(place: Neighbourhood) -> float:
    """Run of a flank that is never touched, m."""
    return UPRIGHT_RUN * place.half_width


def as_bell(part: Part, half: float) -> Part:
    """A round bump or ridge as one whose flanks run out, of a half width (m)."""
    crest: Any = part.shape
    sizes, known = sizes_of(part.feature, crest.tip_radius), part.start[:-1]
    if isinstance(crest, RidgeShape):
        bell: Shape = bell_ridge_beside(crest, sizes)
        known = np.array([part.start[crest.names.index(name)] for name in bell.names[:-2]])
    else:
        bell = bell_beside(crest, sizes)
    return Part(part.feature, bell, np.concatenate([known, [np.log(half), bell.start[-1]]]))


def as_slanted(parts: Sequence[Part], k: int, place: Neighbourhood) -> Part:
    """The k-th of some parts, an upright step, as one that climbs over a run, which begins as `as_smooth` has it."""
    upright: Any = parts[k].shape
    height = float(parts[k].start[upright.modes.count])
    sizes = sizes_of(parts[k].feature, upright.tip_radius)
    slanted = slanted_beside(upright, sizes, float(untouched_run(height, upright.tip_radius)))
    begun = np.concatenate(slanted_beginnings(slanted, parts[k].start, parts[k].feature.details.run))
    return _likeliest(parts, k, slanted, begun, place)


def as_smooth(parts: Sequence[Part], k: int, place: Neighbourhood) -> Part:
    """The k-th of some parts, an upright groove, as one whose walls run out; of several sections the one that is
    likeliest beside the others begins."""
    upright: Any = parts[k].shape
    sizes = sizes_of(parts[k].feature, upright.tip_radius)
    begun = smooth_beginnings(upright, parts[k].start[None], sizes)
    return _likeliest(parts, k, smooth_groove_beside(upright, sizes), begun, place)


def _likeliest(parts: Sequence[Part], k: int, shape: Shape, begun: FloatArray, place: Neighbourhood) -> Part:
    """The k-th of some parts in another family, at the likeliest beside the others of some parameters (N, P)."""
    joined = place.joined([each.shape if m != k else shape for m, each in enumerate(parts)])
    rows = np.tile(
        np.concatenate([each.start if m != k else begun[0] for m, each in enumerate(parts)]), (len(begun), 1)
    )
    rows[:, joined.columns[k]] = begun
    target = LogPosterior(joined, place.levels[-1][0])
    return Part(parts[k].feature, shape, begun[int(np.argmax(target.log_density(rows)))])


def as_twin(part: Part, place: Neighbourhood, gap: float, *, lying: bool = False) -> Part:
    """A ridge as two that leave a gap, m, or as two wires that lie on the base."""
    ridge: Any = part.shape
    twin = twin_beside(ridge, sizes_of(part.feature, ridge.tip_radius), lying=lying)
    start = part.start.copy()
    start[-1] = np.log(0.5 * max(start[-2], 1e-3 * place.half_width))
    start = start[:-1] if lying else start
    return Part(part.feature, twin, np.concatenate([[np.log(gap)], start]))


def laid(parts: Sequence[Part], place: Neighbourhood) -> Configuration:
    """The configuration of these parts as they begin, of no odds: what proposals may begin with."""
    theta = np.concatenate([np.zeros(0), *(part.start for part in parts)])
    nowhere = Laplace(theta, np.zeros((0, 0)), -np.inf)
    return Configuration(tuple(parts), place, nowhere, len(place.levels) - 1, -np.inf, Deviation())


def fitted(
    parts: Sequence[Part], place: Neighbourhood, rival: Configuration | None = None, *, anew: bool = False
) -> Configuration | None:
    """The configuration of these parts at the optimum of all of them together; None if a rival is far better, if what
    it calls two details is felt as one, or if it would do instead of a rival by more than was felt.

    Args:
        parts: the details.
        place: their neighbourhood.
        rival: what they would do instead of.
        anew: True of parts that do not begin where the rival lies: of these it is not known yet how large their misfit
            is, and they are searched to the end unless that promises to be far worse when as much was tried as others
            have in all.
    """
    shape = place.joined([part.shape for part in parts])
    theta = np.concatenate([np.zeros(0), *(part.start for part in parts)])
    constants = np.array([constant for _, constant in place.levels])
    targets = [LogPosterior(shape, likelihood) for likelihood, _ in place.levels]
    level = len(constants) - 1 if rival is None or anew else rival.level
    if rival is not None and len(theta):
        least = rival.hopeless(len(theta), level)
        often = (ITERATIONS, SCREENED) if anew else (SCREENED, LEARNING)
        near = find_optima(targets[level], theta[None], often[0], -2.0 * least, often[1])
        if not near or float(place.levels[level][0].log_density(shape.templates(near[0][None]))[0]) < least:
            return None
        theta = near[0]
    for _ in range(MOST_LEVEL_CHANGES):
        if len(theta):
            theta = find_optima(targets[level], theta[None])[0]
        template = shape.templates(theta[None])
        values = [float(likelihood.log_density(template)[0]) for likelihood, _ in place.levels] + constants
        level, before = int(np.argmax(values)), level
        if level == before or not len(theta):
            break
    moved = tuple(Part(part.feature, part.shape, theta[own]) for part, own in zip(parts, shape.columns, strict=True))
    if not gaps_are_felt(moved, place):
        return None
    found = Laplace(theta, np.zeros((0, 0)), float(values[level] - constants[level]))
    evidence, deviation = found.log_density, Deviation()
    if len(theta):
        found = laplace(targets[level], theta, scanned=False)
        details = [Fitted(part.feature, part.shape, part.start) for part in moved]
        deviation = common_deviation(details, targets[level], PARTS_OF_BIN, place.around.trace.tip_radius)
        evidence = found.log_evidence + deviation.log_factor
    plain = sum(_plain(part, found.covariance[own, own]) for part, own in zip(moved, shape.columns, strict=True))
    prior = sum(_log_prior(part, place) for part in parts)
    odds = evidence + float(constants[level]) - float(np.log(len(constants))) + plain + prior
    whole = Configuration(moved, place, found, level, float(odds), deviation)
    return whole if rival is None or whole.tops_are_felt else None


def gaps_are_felt(parts: Sequence[Part], place: Neighbourhood) -> bool:
    """True if every twin is two: the ball sinks into its gap by more than noise makes of a flat top.

    Two edges of a narrow bar are two blades as well, whose radius and gap are free to leave its trace: it is one
    detail. Wires that lie on the base are as wide as they are high, and two for all that the ball may bridge.
    """
    twins = [part for part in parts if isinstance(part.shape, TwinShape) and not part.shape.lying]
    return all(_gap_strength(part, place) > SINKS_SDS for part in twins)


def _gap_strength(twin: Part, place: Neighbourhood) -> float:
    """Signal-to-noise ratio of the gap of a twin, over the same without one."""
    shape: Any = twin.shape
    gapped, filled = (
        JoinedShape([each], len(place.window), PARTS_OF_BIN).templates(twin.start[None])
        for each in (shape, shape.filled)
    )
    return float(np.linalg.norm(place.levels[0][0].filter.whiten(filled - gapped)[0]))


def _is_hollow(part: Part) -> bool:
    """True of what the ball sinks into."""
    return not stands_out(part.shape) and not isinstance(part.shape, StepShape)


def _log_prior(part: Part, place: Neighbourhood) -> float:
    """Log odds of one detail more before the data: as many false ones are accepted on the path where it may lie.

    Its place is left open within PLACE_OPEN half-widths of where it was proposed. What is proposed wherever the
    residual is highest pays thereby for all the places that it might have been proposed at.
    """
    window, feature = place.window, part.feature
    open_to = PLACE_OPEN * sizes_of(feature, place.around.trace.tip_radius).half_width
    near = distances(window.feet, feature.axis) < open_to
    path = float(2.0 * window.half[near].sum())
    return float(np.log(place.false_alarms_per_metre * max(path, open_to)))


def _plain(part: Part, covariance: FloatArray) -> float:
    """What a wire that lies on the base adds to the log evidence: half of all round lines are such, beforehand.

    By the ratio of the Gaussian's density of the log radius less that of half the height at 0, and the prior's there
    (Savage's ratio; Dickey, Annals of Mathematical Statistics 42, 1971).
    """
    shape: Any = part.shape
    if isinstance(shape, TwinShape) and shape.lying:
        return -float(np.log(2.0))
    ridge = shape.midway if isinstance(shape, TwinShape) else shape
    if not isinstance(ridge, RidgeShape):
        return 0.0
    height, log_radius = max(float(part.start[-2]), NO_HEIGHT), float(part.start[-1])
    variance = _variance_beyond(height, covariance)
    off = log_radius - float(np.log(0.5 * height))
    after = -0.5 * off**2 / variance - 0.5 * float(np.log(2.0 * np.pi * variance))
    before = float(ridge.priors[-1].log_density(np.array(np.log(0.5 * height))))
    return float(np.logaddexp(0.0, after - before) - np.log(2.0))


def _variance_beyond(height: float, covariance: FloatArray) -> float:
    """Variance of the log radius less that of half the height."""
    slope = np.array([-1.0 / height, 1.0])
    return max(float(slope @ covariance[-2:, -2:] @ slope), np.finfo(float).tiny)


def _beyond_wire(part: Part, covariance: FloatArray) -> float:
    """Standard deviations by which a round line is wider than a wire of its height."""
    height = max(float(part.start[-2]), NO_HEIGHT)
    return float((part.start[-1] - np.log(0.5 * height)) / np.sqrt(_variance_beyond(height, covariance)))
