"""Account: the features that rules propose, improved neighbourhood by neighbourhood until the evidence agrees."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mapping import Feature, FloatArray, MappingError, Posterior, Support
from mapping.detection import Crossing
from mapping.geometry.mesh import distances
from mapping.inference import describe
from mapping.inference.configuration.configuration import Configuration, Part, as_bar, fitted, on_its_floor, part_of
from mapping.inference.configuration.neighbourhood import (
    NEIGHBOURHOOD_REACH,
    PARTS_OF_BIN,
    Neighbourhood,
    Places,
    goes_on,
    neighbourhood,
    thin_half_width,
)
from mapping.inference.configuration.proposals import (
    PROPOSALS,
    REMOVE,
    Proposal,
    apart_of,
    as_far_as_felt,
    as_point,
    dense,
    may_be_closed,
    may_be_points,
)
from mapping.inference.configuration.search import (
    CROWDED,
    CROWDED_PARAMETERS,
    MOST_WORK,
    Account,
    searched,
    work_of,
)
from mapping.inference.configuration.told import in_words
from mapping.inference.families import MEETING_REACH, PosteriorProblem, RidgeShape, Surroundings, TwinShape
from mapping.inference.joint import OneOfMany, blocks_of, gaps
from mapping.inference.kinds import kind_of, sizes_of
from mapping.inference.likelihood import Nuisance
from mapping.inference.sampler import root_of

# A line that was found reaches what was a neighbourhood of its own: both are looked at once more, together
LOOKS = 2
# Rounds in which all blocks are laid out beside the others before anything is proposed: held as the rules left them,
# 2 % off in height, one of the 18 blocks of a page of braille misfits by its neighbours; held as they were laid, none
LAID_ROUNDS = 2
# What is less likely than this is not told
TOLD_SHARE = 0.01
# Proposals that change what the posterior weighs once more
CHOSEN_LATER = {"section", "smoother"}
# More of a spot's height than what is not explained of it
MOST_OF_A_SPOT = 0.5
# Draws of the Gaussian that preliminary intervals are taken from
PRELIMINARY_DRAWS = 400
ENDED_EARLY = "the search for what is felt here, and what beside it, ended before all was tried"
# What is said where the likeliest configuration leaves more than noise. Of 200 plates with up to five details (`bench
# odds --counts --building`, seeds 1100 to 1299) the likeliest number is right in 178 of 193 whose configuration fits,
# and in 3 of 7 where it does not
UNEXPLAINED = "not all that is felt here is explained: its form may be another, or there may be more"
NOT_WEIGHED = "so many places tell of it that it was not asked what else it may be"
# What is said of more details, or of more places that tell of some, than are weighed at once
IN_BLOCKS = "more is felt together here than is weighed at once: the details beside were held"


def accounted(
    features: Sequence[Feature],
    crossings: Sequence[Crossing],
    places: Places,
    around: Surroundings,
    false_alarms_per_metre: float,
    proposals: Sequence[Proposal] = PROPOSALS,
    alone: Sequence[Feature] = (),
    measured: Sequence[Feature] = (),
) -> tuple[list[Feature], list[Feature]]:
    """The features of the configurations of highest evidence, and what of `alone` these do not explain; features of a
    neighbourhood that no proposal improves are returned as they are, with what else they may be.

    Args:
        features: that rules propose.
        crossings: all that was detected.
        places: heights that all is weighed on.
        around: trace, base and noise.
        false_alarms_per_metre: accepted rate of invented features, 1/m of path.
        proposals: what is tried.
        alone: spots that a single sweep shows, as where lines cross one does that runs over both at once.
        measured: wide lines whose sizes are known: they are held beside what they reach into.
    """
    bars = [line for line in measured if kind_of(line).line and line.details.top]
    rest, left = [feature for feature in features if not _weighed(feature)], list(alone)
    tip = around.trace.tip_radius
    open_to = [c for c in crossings if not any(_felt_by(c, feature, tip) for feature in rest)]
    known = [_Block([feature], [], frozenset()) for feature in features if _weighed(feature)]
    for again in range(LOOKS):
        origin = {id(feature): k for k, block in enumerate(known) for feature in block.features}
        blocks = [
            block
            for group, own in _groups([feature for block in known for feature in block.features], open_to, tip)
            for block in _blocks(group, own, [origin[id(feature)] for feature in group], places, tip, again > 0)
        ]
        for block in blocks:
            block.explained = all(known[k].explained for k in block.origins)
        # what was left behind by something that is weighed elsewhere now is another number than was told with it
        met = {k for block in blocks if len(block.origins) > 1 for k in block.origins}
        weighed = []
        for block in blocks:
            same = _known_as(block, known, origin) if again else None
            if same is not None:
                block.felt, block.explained = same.felt, same.explained
                block.features = [_noted(feature, (IN_BLOCKS,)) for feature in block.features]
            elif not again or met & block.origins:
                weighed.append(block)
        known_in_all = len(rest) + len(bars) + sum(len(block.features) for block in blocks)
        for _ in range(LAID_ROUNDS):
            for block in weighed:
                _lay(block, _beside(block, blocks, bars, tip), places, around, false_alarms_per_metre, known_in_all)
                if block.laid and len(blocks) > 1:
                    block.felt = _described(block.laid[1], around)
        for block in weighed:
            block.explained = block.understood and (block.laid is None or block.laid[1].fits)
        for block in weighed:
            _lay(
                block,
                _beside(block, blocks, bars, tip, explained=True),
                places,
                around,
                false_alarms_per_metre,
                known_in_all,
            )
            if block.laid is None:
                continue
            improved, best = _improved(block, *block.laid, around, proposals)
            left = [spot for spot in left if not explains(best, spot.axis[0], spot.height.median)]
            noted = again and block.cut
            block.features = [_noted(feature, (IN_BLOCKS,)) for feature in improved] if noted else improved
            block.explained, block.changed = best.fits, best is not block.laid[1]
            block.felt = _described(best, around) if len(blocks) > 1 else improved
        known = blocks
    return [*rest, *(feature for block in known for feature in block.features)], left


@dataclass(eq=False)
class _Block:
    """What is weighed together.

    Args:
        features, crossings: which.
        origins: the blocks that all of its neighbourhood was weighed in before.
        cut: True if it is not the whole of its neighbourhood.
        explained: True if what it holds leaves no more than noise, as far as that was asked.
        understood: False if so many places tell of it that one fit would take what is there for all of them.
        changed: True if a proposal improved it.
        felt: its features where they are likeliest by now, as they are held beside others.
        beside: what was held beside it when it was laid out; None: it was not yet.
        laid: its parts as the rules left them, and the same where they are likeliest; None if too few places tell of
            it, or a feature has no family there.
    """

    features: list[Feature]
    crossings: list[Crossing]
    origins: frozenset[int]
    cut: bool = False
    explained: bool = True
    understood: bool = True
    changed: bool = False
    felt: list[Feature] = field(default_factory=list)
    beside: list[Feature] | None = None
    laid: tuple[list[Part], Configuration] | None = None


def _known_as(block: _Block, known: Sequence[_Block], origin: dict[int, int]) -> _Block | None:
    """The block of the look before that has the same features; None if there is none, or anything about it changed."""
    before = {origin[id(feature)] for feature in block.features}
    if not block.cut or len(before) != 1:
        return None
    (k,) = before
    whole = len(known[k].features) == len(block.features)
    return known[k] if whole and not any(known[m].changed for m in block.origins - before) else None


def _beside(
    block: _Block, blocks: Sequence[_Block], bars: Sequence[Feature], tip: float, *, explained: bool = False
) -> list[Feature]:
    """What of the other blocks, and of bars that are measured, disturbs places that a block is weighed on.

    Args:
        block: the one.
        blocks: all of them.
        bars: wide lines, as they are.
        tip: radius, m.
        explained: True for those alone that leave no more than noise, and those of the same crowd. What is not
            understood itself, as a ridge laid over both rims of a groove, hides what lies between it and others.
    """
    others = [other for other in blocks if other is not block]
    if explained:
        others = [other for other in others if other.explained or (other.cut and other.origins == block.origins)]
    felt = [*(feature for other in others for feature in other.felt or other.features), *bars]
    return [feature for feature in felt if _reaches_into(feature, block, tip)]


def _lay(
    block: _Block,
    beside: list[Feature],
    places: Places,
    around: Surroundings,
    false_alarms_per_metre: float,
    details: int,
) -> None:
    """Lay a block out where it is likeliest beside others, unless it lies there; `details` are known in all.

    What lies beside the block and reaches into its places is held: left out, its flanks would be a misfit of the
    block's own, and be told as more details.
    """
    if block.beside is not None and not block.beside and not beside:
        return
    block.beside, block.laid = beside, None
    elsewhere = details - len(block.features)
    place = neighbourhood(block.features, block.crossings, places, around, false_alarms_per_metre, beside, elsewhere)
    if place is None:
        return
    place = _holding(beside, place)
    own = len(block.features)
    if work_of(CROWDED_PARAMETERS * own + len(place.held), len(place.window)) > MOST_WORK * max(own, 1):
        block.features = [_noted(feature, (NOT_WEIGHED,)) for feature in block.features]
        block.understood = False
        return
    try:
        block.laid = _laid_out(block.features, place)
    except MappingError:  # a feature over whose axis the base does not go on has no family here
        features = [_posable(feature, place) for feature in block.features]
        try:
            block.laid = _laid_out(features, place)
        except MappingError:
            return
    block.features = [part.feature for part in block.laid[0]]


def _laid_out(features: Sequence[Feature], place: Neighbourhood) -> tuple[list[Part], Configuration]:
    """The features' parts as they begin, and where they are likeliest. Raises MappingError."""
    parts = [_begun(feature, place) for feature in features]
    start = fitted(parts, place)
    assert start is not None
    resting = [on_its_floor(part, place) for part in parts] if not start.fits else parts
    if any(new is not old for new, old in zip(resting, parts, strict=True)):
        other = fitted(resting, place)
        if other is not None and other.log_odds > start.log_odds:
            return resting, other
    return parts, start


def _improved(
    block: _Block,
    parts: list[Part],
    start: Configuration,
    around: Surroundings,
    proposals: Sequence[Proposal],
) -> tuple[list[Feature], Configuration]:
    """The features of one block, as they are or better, and the configuration of the highest odds."""
    group = block.features
    if _is_plain(start):
        # it was detected over the bare base: beside others that explain what was felt there it may be nothing
        alone = searched(start, parts, np.zeros((0, 3)), [REMOVE]).best if start.place.held else start
        if not alone.parts:
            return [], alone
        return [_with_odds(feature, (), ()) for feature in _bent_as_fitted(group, start, around)], start
    points = [c.point for c in block.crossings if c.kind == "convex"]
    points += [
        point for feature in group if kind_of(feature).line and kind_of(feature).sign > 0 for point in feature.axis
    ]
    found = searched(start, parts, np.array(points).reshape(-1, 3), proposals)
    odds = _told(found)
    noted = tuple(note for note, is_so in ((ENDED_EARLY, found.bounded), (UNEXPLAINED, not found.best.fits)) if is_so)
    odds = odds if found.best.fits else ()  # among configurations that are all wrong none is probable
    best = found.best if found.best.fits else _not_of_misfit(found)
    # a section or a course alone is the posterior's to choose, but where it begins decides what it finds
    solves = found.best.fits and not found.start.fits
    later = set(found.accepted) <= CHOSEN_LATER and found.best.kinds == found.start.kinds and not solves
    if later or best is found.start:
        laid = _bent_as_fitted(group, found.start, around)
        felt = [_felt_by_runs(feature, found.start.runs(k)) for k, feature in enumerate(laid)]
        return [_with_odds(feature, odds, noted) for feature in felt], found.best
    algorithms = group[0].evidence.algorithms if group else ()
    features = [_with_odds(feature, odds, noted) for feature in _described(best, around, algorithms)]
    return _meeting(features, around.trace.tip_radius), best


def _bent_as_fitted(group: Sequence[Feature], start: Configuration, around: Surroundings) -> list[Feature]:
    """The features as the rules left them, but of a configuration that leaves no more than noise the lines that bend as
    they are fitted: through coarse rows the rules lay a polygon, which is off such a course between them."""
    if not start.fits or not any(kind_of(feature).line and len(feature.axis) > 2 for feature in group):
        return list(group)
    stand = itertools.compress(range(len(group)), start.stands)
    told = {k: feature for k, feature in zip(stand, _described(start, around), strict=True) if _bends(feature, around)}
    return [replace(told[k], evidence=feature.evidence) if k in told else feature for k, feature in enumerate(group)]


def _bends(feature: Feature, around: Surroundings) -> bool:
    """True of a line that leaves its chord by more than it is felt to either side: what noise bends does not."""
    half = sizes_of(feature, around.trace.tip_radius).half_width if kind_of(feature).line else np.inf
    return bool(distances(feature.axis, feature.axis[[0, -1]]).max() > half)


def _not_of_misfit(found: Account) -> Configuration:
    """The best of a search that leaves more than noise, or the plainest that it came through, where the details that
    were added to this do not pay beside its misfit."""
    best, plainest = found.best, found.plainest
    adds = len(best.kinds) > len(plainest.kinds)
    return plainest if adds and not _pays_beside_misfit(best, plainest) else best


def _pays_beside_misfit(best: Configuration, start: Configuration) -> bool:
    """True if what was added to a configuration that does not fit either way pays for itself as if what is left over
    were noise: of an unknown level, and one number for each half-width of path, over which a shape is wrong as a whole
    (Schwarz, Annals of Statistics 6, 1978)."""
    looks = float(2.0 * best.place.window.half.sum()) / best.place.half_width
    left, before = (float(white @ white) for white in (each.white_residual for each in (best, start)))
    more = len(best.found.mean) - len(start.found.mean)
    prior = best.log_prior - start.log_prior
    return 0.5 * looks * float(np.log(before / left)) - 0.5 * more * float(np.log(looks)) + prior > 0.0


def explains(best: Configuration, point: FloatArray, height: float) -> bool:
    """True if a configuration leaves nothing over, and most of a height (m) where that lies, about a point (3,)."""
    near = np.linalg.norm(best.place.window.feet - point, axis=1) < best.place.half_width
    return bool(near.any() and best.fits and (best.template[near] / height).max() > MOST_OF_A_SPOT)


def _begun(feature: Feature, place: Neighbourhood) -> Part:
    """The part of a feature, in the family that it was proposed in."""
    part, top = part_of(feature, place), feature.details.top
    return as_bar(part, place, top) if top and isinstance(part.shape, RidgeShape) else part


def _posable(feature: Feature, place: Neighbourhood) -> Feature:
    """The feature, or the point that a short line may be whose chord leaves the body, where that bends: no line has a
    course there, and unless a point is asked for nothing is."""
    try:
        part_of(feature, place)
    except MappingError:
        point = as_point(feature, place.around.trace.tip_radius)
        return feature if point is None else point
    return feature


def _holding(beside: Sequence[Feature], place: Neighbourhood) -> Neighbourhood:
    """The place with features that reach into it as they are; what has no family there is not held."""
    held = []
    for feature in beside:
        try:
            held.append(_begun(feature, place) if feature.details.free_section else part_of(feature, place))
        except MappingError:
            continue
    theirs = np.concatenate([np.zeros(0), *(part.start for part in held)])
    return replace(place, held=tuple(part.shape for part in held), theirs=theirs)


def _is_plain(start: Configuration) -> bool:
    """True of at most one detail that has no wide section to choose, is not closed perhaps, and leaves nothing that
    the least misfit does not explain: of what was felt of two details as of one line little stands out."""
    wide = any(isinstance(part.shape, RidgeShape) for part in start.parts) and not all(start.as_narrow_as_wires)
    returns = any(may_be_closed(part) or may_be_points(part, start.place) for part in start.parts)
    return len(start.parts) < 2 and not wide and not returns and start.is_explained


def _weighed(feature: Feature) -> bool:
    """True of what has a closed form, and was felt by single sweeps; of a line, in more than one place of it."""
    return kind_of(feature).sampled and not feature.faint and not (kind_of(feature).line and len(feature.axis) < 2)


def _groups(
    features: list[Feature], crossings: Sequence[Crossing], tip: float
) -> list[tuple[list[Feature], list[Crossing]]]:
    """Features whose disturbances touch, directly or by those of crossings between them, and these crossings.

    What single sweeps detected and no feature explains is felt together in groups of its own.
    """
    reach = [sizes_of(feature, tip).half_width for feature in features]
    near = [[k for k, feature in enumerate(features) if _felt_by(c, feature, tip)] for c in crossings]
    parent = list(range(len(features) + len(crossings)))

    def root(i: int) -> int:
        while parent[i] != i:
            i = parent[i]
        return i

    for i, j in np.argwhere(np.triu(gaps(features, reach) < 0.0, 1)):
        parent[root(j)] = root(i)
    for n, own in enumerate(near):
        for k in own:
            parent[root(len(features) + n)] = root(k)
    alone = [n for n, own in enumerate(near) if not own]
    for n, m in itertools.combinations(alone, 2):
        apart = float(np.linalg.norm(crossings[n].point - crossings[m].point))
        if apart < thin_half_width(crossings[n], tip) + thin_half_width(crossings[m], tip):
            parent[root(len(features) + m)] = root(len(features) + n)
    groups: dict[int, tuple[list[Feature], list[Crossing]]] = {}
    for i, feature in enumerate(features):
        groups.setdefault(root(i), ([], []))[0].append(feature)
    for n, crossing in enumerate(crossings):
        groups.setdefault(root(len(features) + n), ([], []))[1].append(crossing)
    return list(groups.values())


def _blocks(
    features: list[Feature], crossings: list[Crossing], origins: Sequence[int], places: Places, tip: float, again: bool
) -> list[_Block]:
    """A neighbourhood as one block, or cut into blocks of details that lie nearest together: of CROWDED, or of fewer
    where so many places tell of them that one fit took longer than that of such a crowd.

    Args:
        features, crossings: of the neighbourhood.
        origins: the blocks that the features were in before.
        places: heights that all is weighed on.
        tip: radius, m.
        again: True if they were weighed in these. Blocks grow from where those met, so that what was cut is weighed
            together.
    """
    if len(features) < 2:
        return [_Block(features, crossings, frozenset(origins))]
    reach = np.array([sizes_of(feature, tip).half_width for feature in features])
    told = [
        distances(places.points, feature.axis) < NEIGHBOURHOOD_REACH * half
        for feature, half in zip(features, reach.tolist(), strict=True)
    ]

    def too_many(block: Sequence[int]) -> bool:
        of_block = np.logical_or.reduce([told[k] for k in block])
        return len(block) > CROWDED or work_of(CROWDED_PARAMETERS * len(block), int(of_block.sum())) > 1.0

    if not too_many(range(len(features))):
        return [_Block(features, crossings, frozenset(origins))]
    gap = gaps(features, list(reach))
    strength = np.array([feature.evidence.snr for feature in features])
    known = np.array(origins)
    met = again & ((gap < 0.0) & (known != known[:, None])).any(axis=1)
    order = [int(k) for k in np.lexsort((-strength, ~met))]
    blocks = blocks_of(gap, order, too_many)
    of_block = {k: number for number, block in enumerate(blocks) for k in block}
    own: list[list[Crossing]] = [[] for _ in blocks]
    for crossing in crossings:
        away = [float(distances(crossing.point[None], feature.axis)[0]) for feature in features] - reach
        own[of_block[int(np.argmin(away))]].append(crossing)
    return [
        _Block([features[k] for k in block], felt, frozenset(origins), cut=True)
        for block, felt in zip(blocks, own, strict=True)
    ]


def _reaches_into(feature: Feature, block: _Block, tip: float) -> bool:
    """True if a feature disturbs places that a block is weighed on."""
    reach = sizes_of(feature, tip).half_width
    windows = [(one.axis, sizes_of(one, tip).half_width) for one in block.features]
    windows += [(crossing.point[None], thin_half_width(crossing, tip)) for crossing in block.crossings]
    return any(
        min(distances(feature.axis, axis).min(), distances(axis, feature.axis).min())
        < reach + NEIGHBOURHOOD_REACH * half_width
        for axis, half_width in windows
    )


def _felt_by(crossing: Crossing, feature: Feature, tip: float) -> bool:
    """True if what a sweep detected may be a part of what a feature disturbs."""
    reach, axis = sizes_of(feature, tip).half_width + crossing.half_width, feature.axis
    if goes_on(feature) and not feature.closed and len(axis) > 1:  # where to, one place does not say
        far = np.linalg.norm(crossing.point - axis[[0, -1]], axis=1)
        ways = axis[[0, -1]] - axis[[1, -2]]
        ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), np.finfo(float).tiny)
        axis = np.vstack([axis[0] + far[0] * ways[0], axis, axis[-1] + far[1] * ways[1]])
    return bool(distances(crossing.point[None], axis)[0] < reach)


def _described(best: Configuration, around: Surroundings, algorithms: tuple[int, ...] = ()) -> list[Feature]:
    """Each part as a feature: beside the others, with intervals from the Gaussian at the optimum."""
    parts = [
        one
        for part in best.parts
        for one in (apart_of(part) if isinstance(part.shape, TwinShape) else [as_far_as_felt(part, best.place)])
    ]
    if any(one is not other for one, other in itertools.zip_longest(parts, best.parts)):
        whole = fitted(parts, best.place)
        assert whole is not None
        best = whole
    if not best.parts:
        return []
    theta, rng = best.found.mean, np.random.default_rng(0)
    likelihood = best.place.levels[best.level][0]
    # by the triangular root, which goes with the covariance: axes of equal variance are turned by rounding alone
    draws = theta + rng.standard_normal((PRELIMINARY_DRAWS, len(theta))) @ root_of(best.found.covariance).T
    features = []
    for k, (part, own) in enumerate(zip(best.parts, best.shape.columns, strict=True)):
        if not best.stands[k]:
            continue
        others = [*(other.shape for other in best.parts if other is not part), *best.place.held]
        theirs = np.append(np.delete(theta, np.arange(own.start, own.stop)), best.place.theirs)
        target = OneOfMany(part.shape, likelihood, None, others, theirs, PARTS_OF_BIN)
        sizes = sizes_of(part.feature, around.trace.tip_radius)
        problem = PosteriorProblem(part.feature, sizes, target, around.noise, Nuisance(0.0, 0.0), part.start[None])
        nan = float("nan")
        some = np.clip(draws[:, own], target.low, target.high)
        some[0] = theta[own]
        posterior = Posterior(part.shape.names, part.shape.units, some, nan, nan, "not needed", "preliminary")
        found = describe(problem, posterior, around.base, likeliest=some[0])
        support = Support(best.strength(k), best.runs(k), algorithms)
        features.append(replace(found, posterior=None, evidence=support))
    return features


def _meeting(features: list[Feature], tip: float) -> list[Feature]:
    """The lines, those that meet others marked; lines that run beside each other do not meet."""
    lines = {k: dense(feature.axis) for k, feature in enumerate(features) if len(feature.axis) > 1}
    met: set[int] = set()
    for k, m in itertools.combinations(lines, 2):
        half = min(sizes_of(features[n], tip).half_width for n in (k, m))
        gaps = [distances(lines[one], features[other].axis) for one, other in ((k, m), (m, k))]
        touching = min(gap.min() for gap in gaps) < MEETING_REACH * half  # an end beneath the other line is not told
        if touching and all(np.median(gap) > half for gap in gaps):
            met |= {k, m}
    return [
        replace(feature, junction=True, notes=("junction", *feature.notes))
        if k in met and kind_of(feature).has_ends
        else replace(feature, junction=False)
        for k, feature in enumerate(features)
    ]


def _told(found: Account) -> tuple[tuple[str, float], ...]:
    """What the neighbourhood may consist of, in words, with the probability of each: what it is told as first, the
    others as they are probable."""
    told = [
        (in_words(kinds), share) for kinds, share in found.shares if share > TOLD_SHARE or kinds == found.best.kinds
    ]
    told.sort(key=lambda each: each[0] != in_words(found.best.kinds))
    return tuple(told) if len(told) > 1 else ()


def _felt_by_runs(feature: Feature, runs: int) -> Feature:
    """A spot with the runs of sweeps that felt it: where spots are felt together few see a crossing in each of them."""
    if kind_of(feature).line:
        return feature
    return replace(feature, evidence=replace(feature.evidence, crossings=max(feature.evidence.crossings, runs)))


def _with_odds(feature: Feature, odds: tuple[tuple[str, float], ...], noted: tuple[str, ...]) -> Feature:
    return _noted(replace(feature, details=replace(feature.details, account=odds or None)), noted)


def _noted(feature: Feature, notes: tuple[str, ...]) -> Feature:
    """The feature with some notes more; each is told once."""
    return replace(feature, notes=tuple(dict.fromkeys((*feature.notes, *notes))))
