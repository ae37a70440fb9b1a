"""A model's features become bodies that can be touched, each by its kind."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import Details, Feature, Interval, ModelError, ObjectModel, Support, Surface
from mapping.base import Base
from mapping.geometry.proxy import Bar, Bell, Chain, Swell, Terrace, Trench
from mapping.model import touchable

PLATE = Surface(0.03 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]])
LINE = np.array([[-5e-3, 0.0, 0.0], [5e-3, 0.0, 0.0]])


def feature(kind: str, axis: np.ndarray, height: float, width: float = 0.4e-3, details: Details = Details()) -> Feature:  # noqa: B008
    sizes = [Interval(each, each, each) for each in (height, width, 10e-3)]
    normals = np.tile([0.0, 0.0, 1.0], (len(axis), 1))
    return Feature(kind, axis, normals, *sizes, Support(10.0, 3), True, 1e-6, details=details)


def model(*features: Feature) -> ObjectModel:
    return ObjectModel.attach(Base(PLATE), features, provenance={})


def test_each_kind_has_its_closed_form() -> None:
    known = model(
        feature("ridge", LINE, 0.3e-3, details=Details(radius=0.2e-3)),
        feature("ridge", LINE, 0.1e-3, 1e-3, Details(top=0.4e-3, run=0.3e-3)),
        feature("ridge", LINE, 0.1e-3, 1e-3, Details(scale=0.5e-3, exponent=-2.5)),
        feature("bump", LINE[:1], 0.2e-3),
        feature("bump", LINE[:1], 0.2e-3, details=Details(scale=0.5e-3, exponent=2.0)),
        feature("groove", LINE, -0.1e-3, 1e-3),
        feature("pit", LINE[:1], -0.1e-3, 1e-3),
        feature("step", LINE, 0.1e-3, 0.0, Details(high_side=-1.0)),
    )
    body, left_out = touchable(known, 5e-3, 2.0)
    assert left_out == ()
    assert [type(part) for part in body.parts] == [Chain, Bar, Swell, Chain, Bell, Trench, Trench, Terrace]
    ridge, bar, groove = body.parts[0], body.parts[1], body.parts[5]
    assert isinstance(bar, Bar) and (bar.height, bar.top, bar.run) == (0.2e-3, 0.8e-3, 0.6e-3)
    assert isinstance(ridge, Chain) and (ridge.height, ridge.radius) == (0.6e-3, 0.4e-3)
    assert isinstance(groove, Trench) and (groove.width, groove.depth) == (2e-3, 0.2e-3)
    assert body.top == 0.6e-3


def test_what_has_no_closed_form_is_left_out_and_named() -> None:
    known = model(feature("step", LINE, 0.1e-3), feature("convex edge", LINE, -0.1e-3), feature("ridge", LINE, -0.1e-3))
    body, left_out = touchable(known, 5e-3)
    assert body.parts == ()
    assert [each.stage for each in left_out] == ["step-1", "convex-edge-1", "ridge-1"]
    # what was measured where it was crossed has a height and a width, and no form
    _, left_out = touchable(model(feature("pit", LINE[:1], -0.1e-3, details=Details(free_section=True))), 5e-3)
    assert [each.stage for each in left_out] == ["pit-1"]


@pytest.mark.parametrize("exaggeration", [0.5, 101.0, float("nan")])
def test_an_exaggeration_out_of_range_is_refused(exaggeration: float) -> None:
    with pytest.raises(ModelError, match="from 1 to 100"):
        touchable(model(), 5e-3, exaggeration)


def test_a_steps_higher_side_is_kept_in_the_file(tmp_path) -> None:  # type: ignore[no-untyped-def]
    known = model(feature("step", LINE, 0.1e-3, 0.0, Details(high_side=-1.0)))
    known.save(tmp_path)
    assert ObjectModel.load(tmp_path)["step-1"].details.high_side == -1.0
