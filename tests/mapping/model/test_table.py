"""A model in a notebook: its features by name, as text, as a table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mapping import Base, Details, Feature, Interval, ModelError, ObjectModel, Support, Surface
from mapping.model.table import dataframe, rows

SQUARE = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
UP = np.array([0.0, 0.0, 1.0])
RIDGE = Feature(
    "ridge",
    np.array([[0.2, 0.3, 0.0], [0.4, 0.3, 0.0], [0.6, 0.3, 0.0]]),
    np.tile(UP, (3, 1)),
    Interval(6.5e-4, 6.4e-4, 6.6e-4),
    Interval(1.3e-3, 1.2e-3, 1.4e-3, censored=True),
    Interval.normal(0.4, 1e-3),
    Support(12.0, 3, log_odds=40.0),
    True,
    1e-5,
    notes=("a <b>remark</b>",),
)


@pytest.fixture
def model() -> ObjectModel:
    return ObjectModel.attach(Base(SQUARE, "plane", {}), [RIDGE, RIDGE])


def test_a_feature_is_found_by_its_name(model: ObjectModel) -> None:
    assert model["ridge-2"] is model.features[1]
    assert len(model) == 2 and list(model) == list(model.features)
    with pytest.raises(KeyError, match="no feature 'bump-1'; possible: ridge-1, ridge-2"):
        model["bump-1"]


def test_a_model_and_its_features_are_told_in_a_line(model: ObjectModel) -> None:
    assert repr(model) == "<ObjectModel: plane base of 2 faces; ridge-1, ridge-2>"
    expected = "<ridge-1: height 0.6500 mm (0.6400 to 0.6600), width at least 1.2 mm, length 400.0 mm (398.4 to 401.6)>"
    assert repr(model["ridge-1"]) == expected


def test_an_interval_is_its_median_as_a_number_and_reads_with_its_unit() -> None:
    assert RIDGE.height > 6e-4 and not RIDGE.height > 7e-4 and RIDGE.height <= 6.5e-4 and RIDGE.height < RIDGE.width
    assert sorted([RIDGE.width, RIDGE.height])[0] is RIDGE.height and float(RIDGE.height) == 6.5e-4
    assert f"{RIDGE.height:um}" == "650.0 um (640.0 to 660.0)"
    assert str(Interval(np.nan, np.nan, np.nan)) == "–"
    with pytest.raises(ValueError, match="'furlong' is not a unit of length"):
        f"{RIDGE.height:furlong}"


def test_the_rows_hold_what_the_features_hold(model: ObjectModel) -> None:
    first, second = rows(model.features)
    assert (first["id"], second["id"]) == ("ridge-1", "ridge-2")
    assert (first["x"], first["y"], first["z"]) == (0.4, 0.3, 0.0)
    assert (first["height"], first["height_low"], first["height_high"]) == (6.5e-4, 6.4e-4, 6.6e-4)
    assert first["width_censored"] and not first["height_censored"]
    assert (first["snr"], first["crossings"], first["log_odds"]) == (12.0, 3, 40.0)
    assert first["face"] in (0, 1)


def test_a_straight_line_of_two_points_is_placed_half_way(model: ObjectModel) -> None:
    line = replace(RIDGE, axis=RIDGE.axis[[0, 2]], normals=RIDGE.normals[[0, 2]])
    (row,) = rows([line])
    np.testing.assert_allclose([row["x"], row["y"], row["z"]], [0.4, 0.3, 0.0], atol=1e-15)


def test_the_table_for_notebooks_shows_text_as_text(model: ObjectModel) -> None:
    html = model._repr_html_()
    assert html.count("<tr>") == 3 and "0.6500 mm (0.6400 to 0.6600)" in html
    assert "<b>" not in html and "a &lt;b&gt;remark&lt;/b&gt;" in html


def test_a_data_frame_has_a_row_for_each_feature_or_says_what_is_missing(model: ObjectModel) -> None:
    try:
        import pandas  # noqa: F401
    except ImportError:
        with pytest.raises(ModelError, match=r"pip install explore3d\[pandas\]"):
            model.to_dataframe()
    else:
        assert list(dataframe(model.features).id) == ["ridge-1", "ridge-2"]


def test_one_of_two_that_may_be_one_is_as_probable_as_the_two() -> None:
    doubtful = replace(RIDGE, details=Details(account=(("two ridges", 0.66), ("one ridge", 0.34))))
    assert [row["probability"] for row in rows([RIDGE, doubtful])] == pytest.approx([1.0, 0.66])
    weak = replace(doubtful, evidence=replace(RIDGE.evidence, log_odds=0.0))
    assert rows([weak])[0]["probability"] == pytest.approx(0.33)
