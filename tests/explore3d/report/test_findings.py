"""What the terminal says of a model: how many features, how large, how sure."""

from __future__ import annotations

from math import inf, nan
from types import SimpleNamespace
from typing import Any

import numpy as np

from explore3d.report.findings import kinds_found, number_text, numbers_found, summary, warnings
from mapping import Dropped, Posterior, place_text
from mapping.detection.path import PathLedger
from mapping.estimate.envelope import RefutedTip
from mapping.feature import Interval
from mapping.inference.configuration import UNEXPLAINED


def feature(name: str, finer: bool, length: Interval) -> SimpleNamespace:
    height = Interval(0.651e-3, 0.648e-3, 0.654e-3)
    return SimpleNamespace(
        id=name,
        curvature_feature=finer,
        height=height,
        width=Interval(1e-3, 1e-3, 1e-3),
        length=length,
        details=SimpleNamespace(misfit=None, account=()),
        notes=(),
        posterior=None,
        log_odds=None,
    )


def analysis(*features: SimpleNamespace, recovered: str = "", limit: float = 0.12e-3, untouched: float = 0.0) -> Any:
    model, trace = SimpleNamespace(features=features, provenance={}, dropped=()), SimpleNamespace(tip_radius=0.01)
    detections = SimpleNamespace(
        detection_limit=limit, probability=0.95, remarks=(), injected=0, recovered=0, threshold=5.0
    )
    return SimpleNamespace(
        model=model,
        trace=trace,
        recovered=recovered,
        detections=detections,
        inspected=SimpleNamespace(untouched=untouched),
        base=SimpleNamespace(kind="mesh"),
        account=None,
        deviation=None,
        refuted_tip=None,
        lifted=None,
        yielding=None,
        sparse=None,
        side=None,
        refused=False,
        scene=None,
        path=None,
        left_out=(),
        judgements=(),
        stopped=None,
        go_on="",
    )


def test_nothing_found_is_said_so() -> None:
    assert summary(analysis())[0] == "no features found"


def test_what_the_sweeps_do_not_decide_is_said_first() -> None:
    one = feature("ridge-1", True, Interval(20e-3, 19e-3, 21e-3))
    one.kind, one.details.account = "ridge", (("one ridge", 0.66), ("two ridges", 0.34))
    line = summary(analysis(one))[0]
    assert line.startswith("1 or 2 features found (one ridge 66 %, two ridges 34 %), 1 of them finer")
    assert kinds_found([one]) == ["ridge"] and numbers_found([one], "ridge") == [1, 2]
    other, sure = (feature(name, True, Interval(0.0, 0.0, 0.0)) for name in ("ridge-2", "bump-1"))
    other.kind, other.details.account = "ridge", (("one ridge", 0.5), ("two ridges and one step", 0.5))
    sure.kind = "bump"
    assert summary(analysis(one, other, sure))[0].startswith("3 to 6 features found, 3 of them")
    assert kinds_found([one, other, sure]) == ["ridge", "bump", "step"]
    numbers = [numbers_found([one, other, sure], kind) for kind in ("ridge", "bump", "step")]
    assert numbers == [[2, 3, 4], [1], [0, 1]]
    assert [number_text(each, "ridge") for each in numbers] == ["2 to 4 ridges", "1 ridge", "0 or 1 ridge"]


def test_from_which_width_on_a_groove_is_seen_is_told_beside_the_limit_of_crests() -> None:
    told = next(line for line in summary(analysis()) if line.startswith("A sharp crest 0.12 mm high"))
    # 0.18 mm under a tip of 10 mm: 2 sqrt(0.18 * (20 - 0.18))
    assert told.endswith(
        "So is a groove 3.8 mm wide or wider, if it is at least as deep as the 0.18 mm that this ball sinks into it."
    )
    coarse = next(line for line in summary(analysis(limit=8e-3)) if line.startswith("A sharp crest 8 mm high"))
    assert coarse.endswith("No groove that is narrower than the ball is seen so.")


def test_a_refuted_tip_is_told_once_and_before_anything_else() -> None:
    found = analysis(feature("bump-1", True, Interval(0.0, 0.0, 0.0)))
    found.refuted_tip = RefutedTip(told=2e-3, largest=3.1e-6, places=17, chance=1e-20)
    first, *others = summary(found)
    assert first == (
        "Warning: the tip was no ball of 2 mm: the trace bends more sharply than such a ball can at 17 places, and "
        "3.1 µm is the largest radius that fits. All that follows rests on that radius and is not to be believed: is "
        "its unit right? Give the right one with --tip-radius, or with --tip-sd how far it may be off."
    )
    assert not any("no ball" in line for line in others)
    found.scene = SimpleNamespace()
    assert "tip.radius in the scene" in summary(found)[0]


def test_what_would_have_been_seen_is_said_with_every_result() -> None:
    seen = "A sharp crest 0.12 mm high or higher is seen with 95 % probability where a sweep crosses it."
    assert summary(analysis())[-1].startswith(f"{seen} So is a groove")
    found = analysis(feature("bump-1", True, Interval(0.0, 0.0, 0.0)))
    assert summary(found)[-1] == summary(analysis())[-1]
    assert summary(analysis(limit=inf))[-1] == (
        "The trace is too short, or its samples too far apart, to say what would have been seen."
    )


def test_on_a_detail_as_wide_as_no_fine_one_nothing_is_promised() -> None:
    wide, fine = (feature(name, True, Interval(0.0, 0.0, 0.0)) for name in ("bump-1", "bump-2"))
    wide.width, fine.width = Interval(90e-3, 85e-3, 95e-3), Interval(79e-3, 78e-3, 81e-3)
    assert "where a sweep crosses it, but not on bump-1, wider than 80 mm. So" in summary(analysis(wide, fine))[-1]
    several = [feature(f"pit-{k}", True, Interval(0.0, 0.0, 0.0)) for k in range(6)]
    for each in several:
        each.width = wide.width
    assert summary(analysis(*several))[-1].count("but not on 6 features, wider than 80 mm. So")


def test_no_sentence_speaks_of_a_surface_that_was_not_swept() -> None:
    first, last = summary(analysis(untouched=0.79))
    assert first == "no features found on the 21 % of the surface that was swept"
    assert "where a sweep crosses it on the 21 % of the surface that was swept. So" in last


def test_where_a_part_is_out_of_reach_the_share_is_of_the_rest() -> None:
    told = analysis()
    told.account = SimpleNamespace(unswept=0.03, unreachable=0.301, warning=str, sentence=str)
    assert summary(told)[0] == "no features found on the 97 % of the reachable surface that was swept"
    told.account.unreachable = 0.003  # which no other sentence shows
    assert summary(told)[0] == "no features found on the 97 % of the surface that was swept"


def test_how_many_are_finer_than_the_tip_is_said_in_words() -> None:
    size = Interval(1e-3, 0.9e-3, 1.1e-3)

    def first(*finer: bool) -> str:
        return summary(analysis(*(feature(f"bump-{k}", each, size) for k, each in enumerate(finer))))[0]

    assert first(True) == "1 feature found, finer than the tip of 10 mm"
    assert first(False) == "1 feature found, gentler than the tip of 10 mm"
    assert first(False, False) == "2 features found, none of them finer than the tip of 10 mm"
    assert first(True, True) == "2 features found, all of them finer than the tip of 10 mm"
    assert first(True, False) == "2 features found, 1 of them finer than the tip of 10 mm"


def test_each_feature_has_a_line_with_its_intervals() -> None:
    found = analysis(
        feature("ridge-1", True, Interval(80e-3, 79.9e-3, 80.1e-3)),
        feature("bump-1", False, Interval(0.0, 0.0, 0.0)),
        feature("ridge-2", False, Interval(50e-3, 40e-3, 60e-3, censored=True)),
    )
    first, ridge, bump, cut, _ = summary(found)
    assert first == "3 features found, 1 of them finer than the tip of 10 mm"
    assert ridge.strip().startswith(
        "ridge-1: height 0.6510 mm (0.6480 to 0.6540), width 1 mm, length 80.00 mm (79.90 to 80.10)"
    )
    assert "length" not in bump
    assert cut.endswith("length at least 40 mm")


def test_what_is_not_certain_has_its_probability() -> None:
    doubtful, sure = (feature(name, True, Interval(0.0, 0.0, 0.0)) for name in ("ridge-1", "ridge-2"))
    doubtful.log_odds, sure.log_odds = 1.53, 5.4
    _, first, second, _ = summary(analysis(doubtful, sure))
    assert first.endswith("width 1 mm; probable as told: 82 %")
    assert second.endswith("width 1 mm")


def test_a_table_says_how_it_was_read_and_how_far_its_samples_reach() -> None:
    found = analysis()
    found.model.provenance["read_as"] = ["x = 'X' mm, z = 'Z' mm, 2 rows in 1 sweep"]
    found.trace.centers = np.array([[0.0, 0.0, 1e-3], [4.8e-3, 0.0, 1.014e-3]])
    assert summary(found)[:2] == [
        "read as: x = 'X' mm, z = 'Z' mm, 2 rows in 1 sweep",
        "extent of the samples: 4.8 mm x 0 mm x 14 µm",
    ]


def test_a_recovered_log_is_mentioned() -> None:
    assert "12 samples lost" in summary(analysis(recovered="12 samples lost"))


def test_a_long_list_is_cut_and_says_so() -> None:
    lines = summary(analysis(*(feature(f"bump-{k}", False, Interval(0.0, 0.0, 0.0)) for k in range(23))))
    assert len(lines) == 23
    assert lines[-2] == "  and 3 more, see the report"


def test_a_path_that_was_left_out_is_said_from_two_per_cent_on() -> None:
    found = analysis()
    found.path = PathLedger(0.216, 0.2, (("gaps", 0.016),), (("turn", 16),))
    assert summary(found)[-1] == (
        "200 mm of 216 mm of path recorded were inspected (92.6 %). Left out: 16 mm (gaps). "
        "Sweeps were cut at 16 turns."
    )
    found.path = PathLedger(0.216, 0.215, (("gaps", 0.001),))
    assert not any("path recorded" in line for line in summary(found))


def test_what_is_clear_of_the_noise_and_in_no_feature_is_said() -> None:
    found = analysis()
    assert warnings(found) == []
    lost = [
        Dropped("step up", np.array([0.02, 0.0, 0.001]), 6e-4, snr, 1, None, "no line") for snr in (6.0, 40.0, 700.0)
    ]
    found.model.dropped = tuple(lost)
    (said,) = warnings(found)
    assert said.startswith(
        "Warning: 2 detections clear of the noise became no feature, the plainest a step up of 0.6 mm"
    )
    assert "(20.0, 0.0, 1.0) mm: no line." in said


def test_a_place_is_told_as_finely_as_the_tip_tells_places_apart() -> None:
    point = np.array([1.5001e-3, 0.0, -1e-9])
    assert place_text(point, 2e-6) == "(1.50010, 0.00000, 0.00000) mm"
    assert place_text(point, 1e-2) == "(1.5, 0.0, 0.0) mm"


def test_intervals_that_rest_on_a_chain_that_did_not_settle_are_said_not_to_be_trusted() -> None:
    sound, stuck = (feature(name, True, Interval(0.05, 0.049, 0.051)) for name in ("ridge-1", "ridge-2"))
    draws = np.zeros((10, 1))
    sound.posterior = Posterior(("height",), ("m",), draws, nan, nan, "not needed", "k-hat 0.2 < 0.5")
    stuck.posterior = Posterior(
        ("height",), ("m",), draws, 376.0, 0.07, "chain too short", "6000 steps are only 16 times"
    )
    assert warnings(analysis(sound)) == []
    assert warnings(analysis(sound, stuck)) == [
        "Warning: ridge-2: its intervals are not to be trusted, 6000 steps are only 16 times."
    ]


def test_a_doubt_of_the_tip_that_was_assumed_is_said() -> None:
    found = analysis()
    found.model.provenance = {"tip_sd_assumed": True, "tip_sd": 1e-4}
    said = summary(found)[-1]
    assert said.startswith("The tip's radius is 10 mm as stated. How well it is known was not stated")
    assert "± 0.1 mm (1 %) is assumed" in said


def test_an_open_number_is_a_warning_unless_the_features_own_form_is_what_is_wrong() -> None:
    ridge, groove = (feature(name, True, Interval(0.01, 0.01, 0.01)) for name in ("ridge-1", "groove-1"))
    ridge.notes = groove.notes = (UNEXPLAINED,)
    groove.details.misfit = "no ideal groove fits"
    said = warnings(analysis(ridge, groove))
    assert [each for each in said if UNEXPLAINED in each] == [f"Warning: ridge-1: {UNEXPLAINED}."]
