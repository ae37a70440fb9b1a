"""What all sweeps together hardly speak for is dropped, and so is what was said of a neighbourhood that counts it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from explore3d.analysis.method import believed
from mapping import Details, Feature, Interval, Support

SAID = (("one bump and one ridge", 0.8), ("two ridges", 0.2))


def feature(x: float, log_odds: float, account: tuple[tuple[str, float], ...] | None) -> Feature:
    size = Interval(1e-4, 0.9e-4, 1.1e-4)
    nothing = Interval(0.0, 0.0, 0.0)
    place, up = np.array([[x, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    support = Support(9.0, 3, (3,), log_odds)
    return Feature("bump", place, up, size, size, nothing, support, True, 1e-5, details=Details(account=account))


def test_an_account_that_counts_what_was_dropped_is_not_told() -> None:
    other = (("one bump", 0.6), ("one pit", 0.4))
    features = (feature(0.0, 9.0, SAID), feature(1e-3, -2.0, SAID), feature(5e-2, 9.0, other), feature(9e-2, 9.0, None))
    work = SimpleNamespace(
        features=features,
        detections=SimpleNamespace(crossings=()),
        trace=SimpleNamespace(tip_radius=1e-3),
        inspections=None,
        backlash=None,
        yielding=None,
        stages=SimpleNamespace(left_out=[]),
    )
    believed(work, lambda share: None)  # type: ignore[arg-type]
    assert [each.details.account for each in work.features] == [None, other, None]
    assert len(work.dropped) == 1 and len(work.stages.left_out) == 1
