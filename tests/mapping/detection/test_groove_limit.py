"""Groove limit: how wide a groove must be to be seen like a crest of the detection limit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from mapping.base.base import Base
from mapping.detection.detect import detect
from mapping.detection.filters.groove_limit import crest_like_groove, groove_dip, narrowest_groove
from mapping.geometry.templates.shapes import groove_height
from mapping.instrument.noise import Noise
from mapping.surface import Surface
from mapping.trace import Trace

TIP, LENGTH = 3e-3, 0.1


def test_the_ball_sinks_into_the_narrowest_groove_half_as_far_again_as_a_crest_is_high() -> None:
    width = narrowest_groove(70e-6, TIP)
    assert -groove_height(0.0, width, TIP) == pytest.approx(groove_dip(70e-6), rel=1e-12)
    assert groove_dip(70e-6) == pytest.approx(1.5 * 70e-6, rel=0.02)
    assert crest_like_groove(width, TIP) == pytest.approx(70e-6, rel=1e-12)


def test_what_a_ball_falls_into_has_no_width_that_decides() -> None:
    assert narrowest_groove(TIP, TIP) == narrowest_groove(np.inf, TIP) == np.inf


@pytest.mark.slow
@pytest.mark.parametrize(("spacing", "white"), [(75e-6, 30e-6), (10e-6, 10e-6)])
def test_the_narrowest_groove_is_found_with_the_stated_probability(spacing: float, white: float) -> None:
    corners = np.array([[-0.2, -0.2, 0], [0.2, -0.2, 0], [0.2, 0.2, 0], [-0.2, 0.2, 0]])
    plate, noise = Base(Surface(corners, [[0, 1, 2], [0, 2, 3]])), Noise(white)
    x = np.arange(-LENGTH / 2, LENGTH / 2, spacing)
    bare = detect(Trace.from_profile(x, np.full(len(x), TIP), TIP), plate, noise=noise)

    def found(width: float) -> int:
        hits = 0
        for seed in range(150):
            rng = np.random.default_rng(seed)
            place = rng.uniform(-0.3, 0.3) * LENGTH
            z = TIP + groove_height(x - place, width, TIP) + white * rng.standard_normal(len(x))
            dips = [c for c in detect(Trace.from_profile(x, z, TIP), plate, noise=noise).crossings if c.height < 0]
            hits += any(abs(c.point[0] - place) < width for c in dips)
        return hits

    narrowest = narrowest_groove(bare.detection_limit, TIP)
    assert found(narrowest) >= binom.ppf(0.01, 150, bare.probability)
    assert found(0.85 * narrowest) < 0.6 * 150
