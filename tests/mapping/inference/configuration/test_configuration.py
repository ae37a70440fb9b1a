"""Details that are felt together are one configuration, and the evidence decides which."""

from __future__ import annotations

import numpy as np
import pytest

from explore3d.bench.detection import NOISE_SOURCES
from explore3d.bench.detection.classify import noisy, touched, trial
from explore3d.bench.scenes import FIRST_BUILT_WITH, classified_body
from mapping import Details
from mapping.assembly import assemble
from mapping.base import Base
from mapping.detection import detect
from mapping.inference.configuration import in_words
from mapping.inference.configuration.proposals import straight_lines


@pytest.mark.parametrize("body", ["wires 2 mm apart", "acute crossing", "flat bar"])
def test_neighbours_are_told_apart_and_a_bar_is_not_taken_for_two(body: str) -> None:
    result = trial(body, "apparatus", "two ways", FIRST_BUILT_WITH)
    assert result["right"], result


def test_where_the_trace_hardly_decides_both_counts_are_stated() -> None:
    seed = FIRST_BUILT_WITH
    scene = classified_body("wires 1 mm apart", seed)
    trace, base = (
        noisy(touched("wires 1 mm apart", "two ways", seed), NOISE_SOURCES["apparatus"], seed),
        Base(scene.base),
    )
    features = assemble(detect(trace, base), trace, base)
    stated = [feature.details.account for feature in features]
    assert stated[0] is not None and all(each == stated[0] for each in stated)
    shares = dict(stated[0])
    assert set(shares) == {"two ridges", "one ridge"} and 0.9 < sum(shares.values()) <= 1.0
    assert Details.read({"account": [list(each) for each in stated[0]]}).account == stated[0]


def test_without_proposals_the_rules_stand() -> None:
    seed = FIRST_BUILT_WITH
    scene = classified_body("wires 2 mm apart", seed)
    trace, base = (
        noisy(touched("wires 2 mm apart", "two ways", seed), NOISE_SOURCES["apparatus"], seed),
        Base(scene.base),
    )
    features = assemble(detect(trace, base), trace, base, proposals=())
    assert [feature.kind for feature in features] == ["ridge"] and features[0].details.account is None


def test_straight_lines_hold_their_points_and_no_others() -> None:
    along = np.linspace(0.0, 10.0, 8)[:, None]
    first, second = along * [1.0, 0.2, 0.0], along * [0.1, 1.0, 0.0] + [20.0, 7.3, 0.0]
    lines = straight_lines(np.concatenate([first, second]), 0.1)
    assert len(lines) == 2
    for line, points in zip(lines, (first, second), strict=True):
        assert min(np.abs(line - points[[0, -1]]).max(), np.abs(line - points[[-1, 0]]).max()) < 1e-9


def test_counts_read_as_people_say_them() -> None:
    assert in_words(("ridge", "ridge", "step")) == "two ridges and one step"
    assert in_words(()) == "nothing"
