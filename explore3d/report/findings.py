"""Findings: what a run or an analysis found, told on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from pathlib import Path

import numpy as np

from explore3d import count_text
from explore3d.analysis import ABSORBED, FAILED, Analysis, swept_share
from mapping import Feature, length_text, place_text
from mapping.detection import CLEAR, LARGEST, groove_dip, narrowest_groove
from mapping.detection.path import PathLedger
from mapping.inference.configuration import UNEXPLAINED, numbers_in
from mapping.model import probability

# One and several of each reason for which a sweep is cut
CUT_NAMES = {
    "turn": ("turn", "turns"),
    "jump": ("jump", "jumps"),
    "beside itself": ("place where it would come beside itself", "places where it would come beside itself"),
    "number given again": ("number that was given again", "numbers that were given again"),
}
# What a job's folder may hold, the first of which that is there is named last
RESULTS = (("report", "report.html"), ("features", "features.csv"))
MOST_REMARKS = 5  # remarks on the form of features; the report and model.json have them all
AS_GOOD_AS_CERTAIN = 0.995  # probability from which on a feature is not said to be doubtful: 100 % where it is rounded
MOST_LISTED_FEATURES = 20  # features that are listed one by one; the report has them all


def show(analysis: Analysis, out: Path, as_json: bool) -> None:
    """Print the model's record as JSON, or a few lines for people."""
    import json

    if as_json:
        print(json.dumps(analysis.model.document(), ensure_ascii=False, allow_nan=False))
    else:
        place = out if analysis.folder is None else analysis.folder
        written = [f"{what}: {place / name}" for what, name in RESULTS if (place / name).is_file()]
        print("\n".join([*stop_lines(analysis), *summary(analysis), *written[:1]]))


def stop_lines(analysis: Analysis) -> list[str]:
    """What must be read before anything else: that the exploration ended early, and how to go on."""
    if analysis.stopped is None:
        return []
    return [f"{analysis.stopped.text}; go on with: {analysis.go_on}" if analysis.go_on else analysis.stopped.text]


def summary(analysis: Analysis) -> list[str]:
    """One line on the whole, one a feature, and one on what would have been seen."""
    features = analysis.model.features
    finer = sum(feature.curvature_feature for feature in features)
    refused = analysis.refused
    odds = undecided_text(features)
    looked = f"{number_text(numbers_found(features), 'feature')} found{odds and f' ({odds})'}{swept_part(analysis)}"
    lines = ["no features were looked for" if refused else looked]
    account = analysis.account
    if features:
        tip = length_text(analysis.trace.tip_radius)
        lines[0] += f", {_finer_text(finer, numbers_found(features))} the tip of {tip}"
    lines = [*read_lines(analysis), *lines]
    if analysis.recovered:
        lines.append(analysis.recovered)
    more = (
        [f"  and {len(features) - MOST_LISTED_FEATURES} more, see the report"]
        if len(features) > MOST_LISTED_FEATURES
        else []
    )
    told = deviation_warning(analysis) if refused else []  # then nothing else means anything: said first
    return [
        *tip_warning(analysis),
        *told,
        *([account.warning()] if account is not None and account.warning() else []),
        *lines,
        *(feature_line(feature) for feature in features[:MOST_LISTED_FEATURES]),
        *more,
        *account_lines(analysis),
        *tolerance_lines(analysis),
        limit_sentence(analysis),
        *[line for line in warnings(analysis) if line not in told],
        *([account.sentence()] if account is not None else []),
    ]


def _finer_text(finer: int, found: Sequence[int]) -> str:
    """ "finer than", "none of them finer than", "3 of them finer than": of how many there are, or may be."""
    if found == [1]:
        return "finer than" if finer else "gentler than"
    share = "none" if not finer else "all" if found == [finer] else str(finer)
    return f"{share} of them finer than"


def read_lines(analysis: Analysis) -> list[str]:
    """How the tables were read, and how far their samples reach: a wrong unit is seen by it at once."""
    read_as = [f"read as: {line}" for line in analysis.model.provenance.get("read_as", [])]
    if not read_as:
        return []
    reach = " x ".join(length_text(float(each)) for each in np.ptp(analysis.trace.centers, axis=0))
    return [*read_as, f"extent of the samples: {reach}"]


def numbers_found(features: Sequence[Feature], kind: str = "") -> list[int]:
    """How many features of a kind, or of any, there may be, in ascending order: several where the sweeps do not
    decide."""
    possible = {sum(not kind or each.kind == kind for each in features if not each.details.account)}
    for account in _undecided(features):
        own = [numbers_in(words) for words, _ in account]
        possible = {before + (each[kind] if kind else each.total()) for before in possible for each in own}
    return sorted(possible)


def kinds_found(features: Sequence[Feature]) -> list[str]:
    """The kinds of features, and those that they may be instead."""
    instead = [numbers_in(words) for account in _undecided(features) for words, _ in account]
    return [*dict.fromkeys([*(each.kind for each in features), *(kind for each in instead for kind in each)])]


def number_text(numbers: Sequence[int], singular: str, plural: str = "") -> str:
    """ "no features", "1 feature", "1 or 2 features", "1 to 4 features"."""
    if len(numbers) == 1:
        return count_text(numbers[0], singular, plural)
    between = "or" if len(numbers) == 2 else "to"
    return f"{numbers[0]} {between} {count_text(numbers[-1], singular, plural)}"


def undecided_text(features: Sequence[Feature]) -> str:
    """ "one ridge 66 %, two ridges 34 %" where one neighbourhood is undecided; of several their own sentences tell."""
    accounts = list(_undecided(features))
    return _shares_text(accounts[0]) if len(accounts) == 1 else ""


def account_lines(analysis: Analysis) -> list[str]:
    """What details that are felt together may be where the trace does not decide, a sentence a neighbourhood."""
    return [
        f"The sweeps do not decide what {' and '.join(names)} {'are' if len(names) > 1 else 'is'}: "
        f"{_shares_text(account)}."
        for account, names in _undecided(analysis.model.features).items()
    ]


def _undecided(features: Sequence[Feature]) -> dict[tuple[tuple[str, float], ...], list[str]]:
    """The accounts of the neighbourhoods that the trace does not decide, with the names of their features."""
    felt: dict[tuple[tuple[str, float], ...], list[str]] = {}
    for feature in features:
        if feature.details.account:
            felt.setdefault(feature.details.account, []).append(feature.id)
    return felt


def _shares_text(account: tuple[tuple[str, float], ...]) -> str:
    return ", ".join(f"{words} {100 * share:.0f} %" for words, share in account)


def warnings(analysis: Analysis) -> list[str]:
    """What a reader must know before believing the rest, a sentence each."""
    return [
        *lifted_sentence(analysis),
        *yielding_sentence(analysis),
        *deviation_warning(analysis),
        *path_warning(analysis),
        *form_warnings(analysis),
        *misfit_warnings(analysis),
        *unexplained_warnings(analysis),
        *posterior_warnings(analysis),
        *dropped_warning(analysis),
        *warning_lines(analysis),
    ]


def tip_warning(analysis: Analysis) -> list[str]:
    """What must be read before anything else that was found: that the tip was none of the radius that was told, or
    that a ball of that radius did not feel what lies between the samples."""
    refuted, sparse, told = analysis.refuted_tip, analysis.sparse, []
    where = "--tip-radius" if analysis.scene is None else "tip.radius in the scene"
    if refuted is not None:
        told.append(
            f"Warning: {refuted.sentence()}. All that follows rests on that radius and is not to be believed: is its "
            f"unit right? Give the right one with {where}, or with --tip-sd how far it may be off."
        )
    side = analysis.side
    if side is not None and side.turned:
        way = "inside" if analysis.base.parameters.get("hollow") else "outside"
        told.append(f"The body was felt from {way}: by the other side, {side.sentence()}.")
    elif side is not None:
        told.append(
            f"Warning: the body seems to lie on the other side of the path: {side.sentence()}. What follows takes what "
            "stands out for what is hollow. z must point away from the body: turn the table by rotation = [[1, 0, 0], "
            "[0, -1, 0], [0, 0, -1]] under [frame] in its sidecar."
        )
    if sparse is not None:
        told.append(
            f"Warning: {sparse.sentence()}. Nothing that follows holds between the samples: is the unit of the radius "
            f"right ({where})?"
        )
    return told


def lifted_sentence(analysis: Analysis) -> list[str]:
    """What was recorded in the air."""
    if analysis.lifted is None:
        return []
    said = analysis.lifted.sentence()
    return [f"{said[0].upper()}{said[1:]}."]


def yielding_sentence(analysis: Analysis) -> list[str]:
    """What the finger yields by, where recorded forces tell it."""
    return [] if analysis.yielding is None else [f"By the recorded forces {analysis.yielding.sentence()}."]


def deviation_warning(analysis: Analysis) -> list[str]:
    """What the given model gets wrong, and what is needed where that cannot be mended."""
    deviation = analysis.deviation
    if deviation is None:
        return []
    said = deviation.sentence()
    needs = f" Needed is {deviation.needs()}." if deviation.beyond_repair else ""
    return [f"{said[0].upper()}{said[1:]}.{needs}"]


def form_warnings(analysis: Analysis) -> list[str]:
    """What was taken for form, what could not be had, and what was assumed of the tip."""
    absorbed = [f"{each.reason[0].upper()}{each.reason[1:]}." for each in analysis.left_out if each.stage == ABSORBED]
    failed = [f"Warning: {each.reason}." for each in analysis.left_out if each.stage == FAILED]
    return [*failed, *absorbed, *tip_sentence(analysis)]


def misfit_warnings(analysis: Analysis) -> list[str]:
    """Features that are not of the form that their sizes are those of."""
    return _feature_warnings(
        [(feature, feature.details.misfit) for feature in analysis.model.features if feature.details.misfit]
    )


def unexplained_warnings(analysis: Analysis) -> list[str]:
    """Features beside which more was felt than is told, where that is not known to be their own form."""
    return _feature_warnings(
        [
            (feature, UNEXPLAINED)
            for feature in analysis.model.features
            if UNEXPLAINED in feature.notes and not feature.details.misfit
        ]
    )


def posterior_warnings(analysis: Analysis) -> list[str]:
    """Features whose intervals rest on draws that do not stand for the posterior."""
    return _feature_warnings(
        [
            (feature, f"its intervals are not to be trusted, {feature.posterior.reason}")
            for feature in analysis.model.features
            if feature.posterior is not None and not feature.posterior.trusted
        ]
    )


def _feature_warnings(wrong: Sequence[tuple[Feature, str]]) -> list[str]:
    more = [f"... and {len(wrong) - MOST_REMARKS} features more."] if len(wrong) > MOST_REMARKS else []
    return [*(f"Warning: {feature.id}: {why}." for feature, why in wrong[:MOST_REMARKS]), *more]


def dropped_warning(analysis: Analysis) -> list[str]:
    """What is no noise whatever its law, and yet in no feature: something is there that the model does not have."""
    least = CLEAR * analysis.detections.threshold
    plain = sorted((each for each in analysis.model.dropped if each.snr > least), key=lambda each: -each.snr)
    if not plain:
        return []
    number = count_text(len(plain), "detection")
    top = plain[0]
    at = place_text(top.point, analysis.trace.tip_radius)
    return [
        f"Warning: {number} clear of the noise became no feature, the plainest a {top.kind} "
        f"of {length_text(abs(top.height), 2)} at {at}: {top.reason}."
    ]


def tip_sentence(analysis: Analysis) -> list[str]:
    """What was assumed of the tip, if its doubt was not stated, or if heights that are off all over may be its own."""
    provenance, radius = analysis.model.provenance, analysis.trace.tip_radius
    sd = float(provenance.get("tip_sd", 0.0))
    if analysis.deviation is not None and "offset" in analysis.deviation.causes and sd > 0.0:
        return [
            f"Heights that are off all over may be the tip's: widths and heights carry ± {length_text(sd, 2)} "
            f"({100 * sd / radius:.2g} %) of doubt of its radius."
        ]
    if not provenance.get("tip_sd_assumed"):
        return []
    return [
        f"The tip's radius is {length_text(radius)} as stated. How well it is known was not stated (--tip-sd states "
        f"it): ± {length_text(sd, 2)} ({100 * sd / radius:.2g} %) is assumed. Widths and heights carry that doubt."
    ]


def path_warning(analysis: Analysis) -> list[str]:
    """What became of the recorded path, where more of it was left out than goes without saying."""
    return [path_sentence(analysis.path)] if analysis.path is not None and analysis.path.is_short else []


def path_sentence(path: PathLedger) -> str:
    """What became of the recorded path."""
    sentence = (
        f"{length_text(path.inspected, 3)} of {length_text(path.recorded, 3)} of path recorded were inspected "
        f"({100 * (1 - path.shortfall):.1f} %)."
    )
    if path.left_out:
        parts = [f"{length_text(length, 2)} ({reason})" for reason, length in path.left_out]
        sentence += f" Left out: {', '.join(parts)}."
    if path.cuts:
        names = [count_text(number, *CUT_NAMES[reason]) for reason, number in path.cuts]
        sentence += f" Sweeps were cut at {', '.join(names)}."
    return sentence


def limit_sentence(analysis: Analysis) -> str:
    """What would have been seen."""
    detections = analysis.detections
    if analysis.refused:
        return "Nothing was looked for over this model, so nothing would have been seen."
    if not isfinite(detections.detection_limit):
        return "The trace is too short, or its samples too far apart, to say what would have been seen."
    return (
        f"A sharp crest {length_text(detections.detection_limit, 2)} high or higher is seen with "
        f"{100 * detections.probability:.0f} % probability where a sweep crosses it{swept_part(analysis)}"
        f"{wide_part(analysis)}{measured_part(analysis)}. "
        f"{groove_sentence(detections.detection_limit, analysis.trace.tip_radius)}"
    )


def groove_sentence(limit: float, tip_radius: float) -> str:
    """From which width on a groove is seen like a crest of the limit's height: a ball feels no more of its depth."""
    narrowest = narrowest_groove(limit, tip_radius)
    if not isfinite(narrowest):
        return "No groove that is narrower than the ball is seen so."
    return (
        f"So is a groove {length_text(narrowest, 2)} wide or wider, if it is at least as deep as the "
        f"{length_text(groove_dip(limit), 2)} that this ball sinks into it."
    )


def wide_part(analysis: Analysis) -> str:
    """'', but not on bump-1, which is wider than 8 mm'': a detail as wide as no fine one is hides what is on it."""
    widest = 2.0 * LARGEST * analysis.trace.tip_radius
    wide = [feature.id for feature in analysis.model.features if feature.width.median > widest]
    if not wide:
        return ""
    which = f"{len(wide)} features" if len(wide) > MOST_REMARKS else " and ".join(wide)
    return f", but not on {which}, wider than {length_text(widest, 2)}"


def measured_part(analysis: Analysis) -> str:
    """'': measured, 58 of 60 that were put into this log were found'' where that was done, else ''."""
    detections = analysis.detections
    if not detections.injected:
        return ""
    return f": measured, {detections.recovered} of {detections.injected} that were put into this log were found"


def warning_lines(analysis: Analysis) -> list[str]:
    """What was promised and had to be changed."""
    return [f"Warning: {remark}." for remark in analysis.detections.remarks]


def swept_part(analysis: Analysis) -> str:
    """'' on the 21 % of the surface that was swept'' where the sweeps did not come near all of it, else ''.

    Where a scene's account leaves out what the finger cannot reach, it is a share of the rest, and said to be.
    """
    share = swept_share(analysis.inspected, analysis.account, analysis.base)
    whole = analysis.account is None or f"{100 * analysis.account.unreachable:.0f}" == "0"
    surface = "surface" if whole else "reachable surface"
    return "" if share == 1.0 else f" on the {100 * share:.0f} % of the {surface} that was swept"


def tolerance_lines(analysis: Analysis) -> list[str]:
    """A line for each tolerance: the verdict, and what it rests on."""
    return [f"{each.verdict}: {each.tolerance.text()} ({each.reason()})" for each in analysis.judgements]


def feature_line(feature: Feature) -> str:
    """A feature's name, its sizes with their intervals, and how probable it is where it is not certain, in one line."""
    sizes = [("height", feature.height), ("width", feature.width), ("length", feature.length)]
    known = [f"{name} {interval}" for name, interval in sizes if interval.median or interval.censored]
    share = probability(feature)
    doubt = "" if share is None or share >= AS_GOOD_AS_CERTAIN else f"; probable as told: {100 * share:.0f} %"
    return f"  {feature.id}: {', '.join(known)}{doubt}"
