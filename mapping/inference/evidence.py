"""Evidence: the marginal likelihood of the trace under one family of shapes, its parameters integrated out.

By it a section is chosen. A ball of 10 mm feels the top of a line and bridges its flanks: a round wire, a bar and a
roof may leave one trace, and so may a cap and a bell. Each family's weight is its evidence; sizes are drawn from all
that remain likely. A round section has a width, as a wire has; of one whose flanks were not touched the width lies
between bounds, and where such sections are more probable than not these are all that is known. Else a bell beside them
is as wide as its prior has it: like a round one it is about as wide as high, within a factor of e or so.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from mapping import Feature, FloatArray, Interval, Posterior, length_text
from mapping.inference.families import (
    BellRidgeShape,
    BellShape,
    FlatTopped,
    FrustumShape,
    PosteriorProblem,
    RoundedFrustumShape,
    ShoulderedShape,
    StepShape,
    Surroundings,
    WornTipShape,
    with_free_tip,
    with_nominal_tip,
)
from mapping.inference.kinds import kind_of
from mapping.inference.likelihood import LogPosterior, Shape
from mapping.inference.sampler import find_optima, importance_sample, laplace

# A family whose probability is below this one leaves every 90 % interval as it is, to within half of its tail
UNLIKELY_FAMILY = 0.05
AVERAGED_DRAWS = 4000
# Probability of sections whose flanks the ball bridged from which on the median width is none of its own
MOSTLY_BRIDGED = 0.5
# The Gaussian approximation of a log evidence was off by -2.0 to +2.9 (33 families of 11 lines of explore3d bench
# sections --building): what it takes for less likely by more than both of these is
ROUGH_EVIDENCE = 5.0


def log_evidence(problem: PosteriorProblem, rng: np.random.Generator) -> float:
    """Log of the integral of likelihood and prior over the parameters, by importance sampling.

    A prior wider than the data need costs what it should (Occam's factor). Evidences compare between problems that
    have the same window, noise and nuisance.
    """
    optima = find_optima(problem.target, problem.beginnings)
    return importance_sample(problem.target, [laplace(problem.target, each) for each in optima], rng).log_evidence


def log_evidence_of_nothing(target: LogPosterior) -> float:
    """The same where only the base, and neighbours that the target knows of, left the trace."""
    return float(target.likelihood.log_density(target.bare)[0])


def at_optima(problem: PosteriorProblem) -> PosteriorProblem:
    """The problem that begins where its searches end."""
    return replace(problem, beginnings=np.array(find_optima(problem.target, problem.beginnings)))


def rough_evidence(problem: PosteriorProblem) -> float:
    """The Gaussian approximation of the log evidence of a problem that begins at its optima."""
    return max(laplace(problem.target, optimum).log_evidence for optimum in problem.beginnings)


def roughly_weighed(problems: Iterable[PosteriorProblem]) -> list[tuple[float, PosteriorProblem]]:
    """Rivals that begin at their optima, each with its rough log evidence, as far as they may be likely beside those
    before them; the first of them is one.

    No evidence is higher than the likelihood at its best: where that is too low for a family to be likely, it is
    neither searched to its end nor integrated over.
    """
    weighed, most = list[tuple[float, PosteriorProblem]](), np.inf
    for problem in problems:
        optima = find_optima(problem.target, problem.beginnings, most=most)
        if not optima:
            continue
        found = replace(problem, beginnings=np.array(optima))
        weighed.append((rough_evidence(found), found))
        likely = max(evidence for evidence, _ in weighed) + float(np.log(UNLIKELY_FAMILY)) - ROUGH_EVIDENCE
        most = -2.0 * likely
    return weighed


def better_section(first: PosteriorProblem, around: Surroundings, rng: np.random.Generator) -> PosteriorProblem | None:
    """The alternative of a kind beside which its first family is unlikely under the noise of the trace, else None.

    What none of them explains speaks for none: a groove that 2,000 noisy crossings show otherwise than any family would
    has them change places by chance, and with them where its ends are.

    Args:
        first: the posed problem of a feature that the first family does not fit within that noise.
        around: what it was posed in.
        rng: randomness of the importance sampling, of those whose Gaussian approximations do not decide.
    """
    plain = replace(with_nominal_tip(first.under(around.noise)), misfit=0.0)
    posed = kind_of(first.feature).alternatives(plain, around)
    if not posed:
        return None
    if around.tip_sd > 0.0:
        posed = [with_free_tip(each, around.tip_sd, around.base.level_was_felt) for each in posed]
    weighed = roughly_weighed((first.under(around.noise), *posed))
    evidence, families = [each for each, _ in weighed], [each for _, each in weighed]
    least = float(np.log(1.0 / UNLIKELY_FAMILY))
    likely = [k for k, each in enumerate(evidence) if each > max(evidence) - ROUGH_EVIDENCE - least]
    if len(likely) > 1:
        for k in likely:
            evidence[k] = log_evidence(families[k], rng)
    best = max(likely, key=lambda k: evidence[k])
    return families[best] if best > 0 and evidence[best] > evidence[0] + least else None


def probabilities(log_evidences: list[float]) -> FloatArray:
    """Of families that were equally probable beforehand."""
    weights = np.exp(np.array(log_evidences) - max(log_evidences))
    return np.asarray(weights / weights.sum())


def averaged(feature: Feature, likely: Sequence[tuple[float, PosteriorProblem, Posterior]]) -> Feature:
    """The feature with the sizes that all likely families agree on.

    Under a tip that is most probably worn flat the width is bounded from above alone: the flat makes a plateau of any
    crest. What most probably runs out has no foot: its width is that at half height, in all families. Beside a section
    with an edge, whose width is that of its foot, what runs out counts as one that is as wide half way up.

    Args:
        feature: as its most probable family describes it.
        likely: weight, problem and posterior of each family, the most probable one first.
    """
    worn = _worn_note(likely)
    feature = replace(feature, notes=(*feature.notes, *worn))
    kind, shapes = kind_of(feature), [_shape(problem) for _, problem, _ in likely]
    if len(likely) == 1 and not worn and not isinstance(shapes[0], BellRidgeShape | FlatTopped):
        return feature
    bells = [isinstance(shape, BellShape | BellRidgeShape) for shape in shapes]
    total, foot = sum(share for share, _, _ in likely), 1.0
    parts: list[FloatArray] = []
    for shape, bell, (share, _, posterior) in zip(shapes, bells, likely, strict=True):
        draws = posterior.samples[:, : len(shape.names)]
        count = round(AVERAGED_DRAWS * share / total)
        some = draws[np.linspace(0, len(draws) - 1, count).astype(np.int64)]
        widths = kind.widths_felt(shape, some, half_way=bells[0])
        if not parts and any(bells) and not bell:
            half = float(np.median(kind.widths_felt(shape, some, half_way=True)[0]))
            foot = float(np.median(widths[0])) / half if half > 0.0 else 1.0  # of a roof nothing but its top is touched
        factor = foot if bell else 1.0
        own = (2.0 * np.exp(some[:, -2]),) * 2 if bell else widths
        columns = kind.draws_of_height(shape, some), *(factor * each for each in (*widths, *own))
        parts.append(np.column_stack(columns))
    height, touched, bridged, least, most = np.concatenate(parts).T
    # the sign of a step is the side that it was come from
    interval = Interval.from_draws(-height if kind.sided and feature.height.median < 0.0 else height)
    upright = isinstance(shapes[0], StepShape) and not shapes[0].slanted  # it has none, however it may climb
    names = ", ".join(f"{name_of(problem)} {100 * share / total:.0f} %" for share, problem, _ in likely)
    known = f"sections that leave this trace: {names}"
    if np.mean(bridged > touched) < MOSTLY_BRIDGED:
        low, high = np.quantile(least, 0.05), np.quantile(most, 0.95)
        width = Interval(float(np.median(least[least == most])), float(low), float(high))
        width = feature.width if upright else width
        if worn:  # its flat makes the plateau: a sharper crest leaves this trace, too, which no round section tells
            width = replace(width, low=0.0, censored=True, bounded=True)
        notes = (f"{known}; width at half height" if bells[0] else known,) if len(likely) > 1 else ()
        return replace(feature, height=interval, width=width, notes=(*feature.notes, *notes))
    low, high = np.quantile(touched, 0.05), np.quantile(bridged, 0.95)
    width = Interval(float(np.median(touched)), float(low), float(high), censored=True, bounded=True)
    note = (
        f"the tip bridged its flanks: it touched a width of {length_text(width.median, 2)}, and "
        f"{'at half height it' if bells[0] else 'the foot'} may be anything up to {length_text(width.high, 2)} wide "
        f"({known})"
    )
    return replace(feature, height=interval, width=width, notes=(*feature.notes, note))


def _worn_note(likely: Sequence[tuple[float, PosteriorProblem, Posterior]]) -> tuple[str, ...]:
    """That the tip is most probably worn, and how probable that is; nothing where it is not."""
    worn = [(share, each.target.shape) for share, each, _ in likely if isinstance(each.target.shape, WornTipShape)]
    probability = sum(share for share, _ in worn) / sum(share for share, _, _ in likely)
    if probability < 0.5:
        return ()
    depth, across = worn[0][1].depth, worn[0][1].across
    return (
        f"it was felt by a tip that is worn flat, by {length_text(depth, 2)}, which is {length_text(across, 2)} across "
        f"(probability {100 * probability:.0f} %)",
    )


def name_of(problem: PosteriorProblem) -> str:
    """What people call a problem's section."""
    worn = isinstance(problem.target.shape, WornTipShape)
    return f"{_section_name(_shape(problem))}{' under a worn tip' if worn else ''}"


def _section_name(shape: Shape) -> str:
    if isinstance(shape, BellShape | BellRidgeShape):
        return "bell"
    if isinstance(shape, ShoulderedShape | RoundedFrustumShape):
        return "flat-topped with round edges"
    if isinstance(shape, StepShape):
        return "slanted" if shape.slanted else "upright"
    if not isinstance(shape, FlatTopped):
        return "round"
    if not shape.roof:
        return "flat-topped"
    return "conical" if isinstance(shape, FrustumShape) else "triangular"


def _shape(problem: PosteriorProblem) -> Shape:
    return with_nominal_tip(problem).target.shape
