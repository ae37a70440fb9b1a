"""Models, features and posteriors draw themselves with matplotlib: what is on the axes is what they hold."""

import itertools
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from reported_wire import BASE, ridge

from mapping.base import fit_base
from mapping.feature import Feature, Interval, Support
from mapping.model.object_model import ObjectModel
from mapping.posterior import Posterior
from mapping.trace import Trace


@pytest.fixture(autouse=True)
def without_a_screen() -> None:
    matplotlib.use("Agg")


def test_a_model_names_each_feature_where_it_is() -> None:
    model = ObjectModel.attach(BASE, (ridge(),))
    axes = model.plot()
    (label,) = axes.texts
    assert label.get_text().strip() == "ridge-1"
    (first, last) = model["ridge-1"].axis  # straight: its middle is none of its points
    np.testing.assert_allclose(label.get_position_3d(), 1e3 * 0.5 * (first + last), atol=1e-9)
    assert axes.get_xlabel() == "x (mm)"
    assert len(axes.collections) == 2  # the base and the ridge


def test_a_profile_shows_the_height_of_each_feature_where_it_is() -> None:
    x = np.linspace(0.0, 4e-3, 400)
    trace = Trace(x, np.column_stack([x, 0.0 * x, 2e-6 + 0.0 * x]), np.zeros(400, dtype=np.int64), 2e-6)
    size = Interval(3e-7, 2e-7, 4e-7)
    at = np.array([[1.5e-3, 0.0, 0.0]])
    bump = Feature("bump", at, np.array([[0.0, 0.0, 1.0]]), size, Interval(2e-6, 1e-6, 3e-6), Interval(0, 0, 0),
                  Support(9.0, 1), True, 1e-9)  # fmt: skip
    axes = ObjectModel.attach(fit_base(trace), (bump,)).plot()
    (label,) = axes.texts
    assert label.get_text() == "bump-1" and label.xy == pytest.approx((1.5, 0.3))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (mm)", "height over the base (µm)")


def test_a_feature_shows_each_size_with_its_interval() -> None:
    feature = replace(ridge(), id="ridge-7", width=Interval(1e-3, 8e-4, 1.1e-3))
    axes = feature.plot()
    assert axes.get_title() == "ridge-7"
    names = [each.get_text() for each in axes.get_yticklabels()]
    assert "width" in names
    bar = axes.lines[2 * names.index("width")]
    np.testing.assert_allclose(bar.get_xdata(), [0.8, 1.1])
    assert str(feature.width) in {each.get_text() for each in axes.texts}


def test_a_posterior_has_a_panel_for_each_parameter() -> None:
    draws = np.random.default_rng(1).normal([0.6533e-3, 2.0e-3, 0.0, 4.0, 5.0], [3e-6, 1e-4, 1e-5, 0.1, 0.1], (300, 5))
    names = ("height", "width", "x", "angle", "end")
    figure = Posterior(names, ("m", "m", "m", "rad", ""), draws, 1.0, 0.3, "converged").plot()
    assert [each.get_xlabel() for each in figure.axes] == ["height (mm)", "width (mm)", "x (µm)", "angle (rad)", "end"]
    median = figure.axes[2].lines[0].get_xdata()[0]
    assert median == pytest.approx(1e6 * np.median(draws[:, 2]))
    figure.canvas.draw()
    for axes in figure.axes:  # no number runs into the next one
        boxes = [each.get_window_extent() for each in axes.get_xticklabels() if each.get_text() and each.get_visible()]
        boxes = [box for box in boxes if axes.bbox.x0 <= 0.5 * (box.x0 + box.x1) <= axes.bbox.x1]
        assert all(one.x1 < other.x0 for one, other in itertools.pairwise(boxes))
