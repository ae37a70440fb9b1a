"""Account: the features that rules propose, improved neighbourhood by neighbourhood until the evidence agrees."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapping import Feature, FloatArray, MappingError, Posterior, Support
from mapping.detection import Crossing
from mapping.geometry.mesh import distances
from mapping.inference import describe
from mapping.inference.configuration.configuration import Configuration, fitted, part_of
from mapping.inference.configuration.joined_shape import JoinedShape, OneOfMany
from mapping.inference.configuration.neighbourhood import PARTS_OF_BIN, Neighbourhood, Places, neighbourhood
from mapping.inference.configuration.proposals import PROPOSALS, Proposal, apart_of, dense
from mapping.inference.configuration.search import Account, searched
from mapping.inference.families import PosteriorProblem, Surroundings, TwinShape
from mapping.inference.kinds import kind_named, kind_of, sizes_of
from mapping.inference.likelihood import Nuisance

# A line disturbs its trace over this much more than a thin wire of its height does, where it may be a bar or two: the
# half-width that assembly finds is known to some hundredths
WIDER = 1.06
# A line that was found reaches what was a neighbourhood of its own: both are looked at once more, together
LOOKS = 2
# What is less likely than this is not told
TOLD_SHARE = 0.01
# Draws of the Gaussian that preliminary intervals are taken from
PRELIMINARY_DRAWS = 400
# Lines nearer to each other than this share of a half-width meet
MEETING_SHARE = 0.25


def accounted(
    features: Sequence[Feature],
    crossings: Sequence[Crossing],
    places: Places,
    around: Surroundings,
    false_alarms_per_metre: float,
    proposals: Sequence[Proposal] = PROPOSALS,
) -> list[Feature]:
    """The features of the configurations of highest evidence; those of a neighbourhood that no proposal improves are
    returned as they are, with what else they may be.

    Args:
        features: that rules propose.
        crossings: all that was detected.
        places: heights that all is weighed on.
        around: trace, base and noise.
        false_alarms_per_metre: accepted rate of invented features, 1/m of path.
        proposals: what is tried.
    """
    rest = [feature for feature in features if not _weighed(feature)]
    settled: list[list[Feature]] = [[feature] for feature in features if _weighed(feature)]
    for again in range(LOOKS):
        origin = {id(feature): k for k, known in enumerate(settled) for feature in known}
        found: list[list[Feature]] = []
        for group, own in _groups([feature for known in settled for feature in known], crossings, around):
            if again and len({origin[id(feature)] for feature in group}) == 1:
                found.append(group)
            else:
                found.append(_improved(group, own, places, around, false_alarms_per_metre, proposals))
        settled = found
    return [*rest, *(feature for group in settled for feature in group)]


def _improved(
    group: list[Feature],
    crossings: Sequence[Crossing],
    places: Places,
    around: Surroundings,
    false_alarms_per_metre: float,
    proposals: Sequence[Proposal],
) -> list[Feature]:
    """The features of one neighbourhood, as they are or better."""
    if _is_plain(group, crossings, around.trace.tip_radius):
        return group
    place = neighbourhood(group, [c.point for c in crossings], places, around, false_alarms_per_metre)
    return group if place is None else _of_group(group, crossings, place, around, proposals)


def _of_group(
    group: list[Feature],
    crossings: Sequence[Crossing],
    place: Neighbourhood,
    around: Surroundings,
    proposals: Sequence[Proposal],
) -> list[Feature]:
    """The features of the best configuration of one neighbourhood."""
    try:
        parts = [part_of(feature, place) for feature in group]
    except MappingError:  # a feature over whose axis the base does not go on has no family here
        return group
    points = [c.point for c in crossings if c.kind == "convex"]
    points += [
        point for feature in group if kind_of(feature).line and kind_of(feature).sign > 0 for point in feature.axis
    ]
    found = searched(parts, place, np.array(points).reshape(-1, 3), proposals)
    odds = _told(found)
    # a section alone is the posterior's to choose, and what explains the trace no better than in part is no account
    if not found.best.fits or (set(found.accepted) <= {"section"} and found.best.kinds == found.start.kinds):
        return [_with_odds(feature, odds if found.best.fits else ()) for feature in group]
    algorithm = group[0].evidence.algorithms
    features = [_with_odds(feature, odds) for feature in _described(found.best, around, algorithm)]
    return _meeting(features, around.trace.tip_radius)


def _weighed(feature: Feature) -> bool:
    """True of what has a closed form, and was felt by single sweeps."""
    return kind_of(feature).sampled and not feature.faint


def _groups(
    features: list[Feature], crossings: Sequence[Crossing], around: Surroundings
) -> list[tuple[list[Feature], list[Crossing]]]:
    """Features whose disturbances touch, directly or by those of crossings between them, and these crossings."""
    tip = around.trace.tip_radius
    reach = [sizes_of(feature, tip).half_width for feature in features]
    near = [
        [c for c in crossings if distances(c.point[None], feature.axis)[0] < own + c.half_width]
        for feature, own in zip(features, reach, strict=True)
    ]
    parent = list(range(len(features)))

    def root(i: int) -> int:
        while parent[i] != i:
            i = parent[i]
        return i

    for i, j in itertools.combinations(range(len(features)), 2):
        touching = min(
            distances(features[i].axis, features[j].axis).min(), distances(features[j].axis, features[i].axis).min()
        )
        shared = {id(c) for c in near[i]} & {id(c) for c in near[j]}
        if touching < reach[i] + reach[j] or shared:
            parent[root(j)] = root(i)
    groups: dict[int, tuple[list[Feature], dict[int, Crossing]]] = {}
    for k, feature in enumerate(features):
        own, held = groups.setdefault(root(k), ([], {}))
        own.append(feature)
        held |= {id(c): c for c in near[k]}
    return [(own, list(held.values())) for own, held in groups.values()]


def _is_plain(group: list[Feature], crossings: Sequence[Crossing], tip: float) -> bool:
    """True of one detail that is as narrow as it is high, or hollow, and explains all crossings about it."""
    if len(group) > 1:
        return False
    feature = group[0]
    half = sizes_of(feature, tip).half_width
    off = [c for c in crossings if distances(c.point[None], feature.axis)[0] > half]
    if off:
        return False
    thin = float(np.sqrt(2.0 * tip * abs(feature.height.median)))
    wide = kind_of(feature).line and kind_of(feature).sign > 0 and 0.5 * feature.width.high > WIDER * thin
    turns = kind_of(feature).line and len(feature.axis) > 3 and _turns(feature.axis)
    return not (wide or turns)


def _turns(axis: FloatArray) -> bool:
    """True of a polyline that turns back on itself at a corner, as two lines do that were taken for one."""
    legs = np.diff(axis, axis=0)
    legs = legs / np.maximum(np.linalg.norm(legs, axis=1, keepdims=True), np.finfo(float).tiny)
    return bool((np.einsum("ij,ij->i", legs[1:], legs[:-1]) < 0.5).any())


def _described(best: Configuration, around: Surroundings, algorithms: tuple[int, ...]) -> list[Feature]:
    """Each part as a feature: beside the others, with intervals from the Gaussian at the optimum."""
    twins = [part for part in best.parts if isinstance(part.shape, TwinShape)]
    if twins:
        parts = [
            one for part in best.parts for one in (apart_of(part) if isinstance(part.shape, TwinShape) else [part])
        ]
        whole = fitted(parts, best.place)
        assert whole is not None
        best = whole
    theta, rng = best.found.mean, np.random.default_rng(0)
    likelihood = best.place.levels[best.level][0]
    draws = rng.multivariate_normal(theta, best.found.covariance, PRELIMINARY_DRAWS, method="eigh")
    features = []
    for k, (part, own) in enumerate(zip(best.parts, best.shape.columns, strict=True)):
        others = [other.shape for other in best.parts if other is not part]
        theirs = np.delete(theta, np.arange(own.start, own.stop))
        target = OneOfMany(part.shape, likelihood, None, others, theirs, PARTS_OF_BIN)
        sizes = sizes_of(part.feature, around.trace.tip_radius)
        problem = PosteriorProblem(part.feature, sizes, target, around.noise, Nuisance(0.0, 0.0), part.start[None])
        nan = float("nan")
        some = np.clip(draws[:, own], target.low, target.high)
        some[0] = theta[own]
        posterior = Posterior(part.shape.names, part.shape.units, some, nan, nan, "not needed", "preliminary")
        found = describe(problem, posterior, around.base)
        features.append(replace(found, posterior=None, evidence=_support(k, best, algorithms)))
    return features


def _support(k: int, best: Configuration, algorithms: tuple[int, ...]) -> Support:
    """Signal-to-noise ratio of the k-th part, and the runs that felt it."""
    part = best.parts[k]
    template = JoinedShape([part.shape], len(best.place.window), PARTS_OF_BIN).templates(part.start[None])
    white = best.place.levels[0][0].filter.whiten(template)[0]
    return Support(float(np.sqrt(white @ white)), best.runs(k), algorithms)


def _meeting(features: list[Feature], tip: float) -> list[Feature]:
    """The lines, those that meet others marked."""
    result = []
    for feature in features:
        near = MEETING_SHARE * sizes_of(feature, tip).half_width
        others = [dense(other.axis) for other in features if other is not feature and len(other.axis) > 1]
        meets = len(feature.axis) > 1 and kind_of(feature).has_ends
        meets = meets and any(
            min(distances(dense(feature.axis), o).min(), distances(o, feature.axis).min()) < near for o in others
        )
        notes = ("junction", *feature.notes) if meets else feature.notes
        result.append(replace(feature, junction=meets, notes=notes))
    return result


def _told(found: Account) -> tuple[tuple[str, float], ...]:
    """What the neighbourhood may consist of, in words, with the probability of each; the most probable first."""
    told = [(in_words(kinds), share) for kinds, share in found.shares if share > TOLD_SHARE]
    return tuple(told) if len(told) > 1 else ()


def in_words(kinds: Sequence[str]) -> str:
    """Kinds of features as people count them: "one step and two ridges"."""
    numbers = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
    parts = []
    for name, count in Counter(kinds).items():
        number = numbers[count] if count < len(numbers) else str(count)
        parts.append(f"{number} {name if count == 1 else kind_named(name).plural}")
    return " and ".join(parts) if parts else "nothing"


def _with_odds(feature: Feature, odds: tuple[tuple[str, float], ...]) -> Feature:
    return replace(feature, details=replace(feature.details, account=odds or None))
