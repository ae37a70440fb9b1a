"""What is kept of a posterior: draws that ArviZ reads, and pictures of them."""

from __future__ import annotations

import numpy as np
import pytest

from explore3d.analysis.arviz_export import arviz_export
from explore3d.pictures.corner import corner_picture
from mapping.base.base import Base
from mapping.feature import Feature, Interval, Support
from mapping.model.object_model import ObjectModel
from mapping.posterior import Posterior
from mapping.surface import Surface

UP = np.array([0.0, 0.0, 1.0])


def bump(posterior):
    sizes = Interval.normal(0.5e-3, 1e-5), Interval.normal(1e-3, 1e-4), Interval(0.0, 0.0, 0.0)
    return Feature("bump", np.zeros((1, 3)), UP[None], *sizes, Support(30.0, 4), True, 1e-5, posterior)


def model():
    draws = np.random.default_rng(0).standard_normal((400, 3)) * [1e-5, 1e-5, 0.3] + [0.0, 0.5e-3, -7.0]
    posterior = Posterior(("along", "height", "log radius"), ("m", "m", "ln m"), draws, 3.0, 0.4, "converged")
    corners = np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0.0]])
    base = Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))
    return ObjectModel.attach(base, [bump(posterior), bump(None)])


def test_arviz_reads_the_saved_draws_bit_for_bit(tmp_path):
    arviz = pytest.importorskip("arviz")
    saved = model()
    saved.save(tmp_path)
    exported = arviz_export(tmp_path)
    assert list(exported) == ["bump-1"]
    posterior = exported["bump-1"].posterior
    np.testing.assert_array_equal(posterior["height"].values[0], saved.features[0].posterior.draws("height"))
    assert posterior["height"].attrs["units"] == "m" and posterior.attrs["status"] == "converged"
    summary = arviz.summary(exported["bump-1"], var_names=["height"], round_to="none")
    assert summary["mean"].iloc[0] == pytest.approx(0.5e-3, rel=0.01)


def test_a_corner_plot_is_drawn_where_something_was_sampled():
    sampled, bare = model().features
    drawing = corner_picture(sampled)
    assert drawing.startswith(b"<svg") and corner_picture(bare) is None
    assert all(name in drawing for name in (b">along<", b">height<", b">log radius<", b"400 draws, chain converged"))
