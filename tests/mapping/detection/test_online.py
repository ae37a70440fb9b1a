"""What online detection costs."""

from __future__ import annotations

from time import process_time

import numpy as np
import pytest

from mapping.base.base import Base
from mapping.detection.online import OnlineDetector
from mapping.geometry.templates.shapes import cap_height
from mapping.instrument.noise import Noise
from mapping.surface import Surface

TIP, SPACING = 0.01, 6e-6


@pytest.mark.slow
def test_a_stream_of_5_khz_leaves_most_of_a_core_free():
    base = Base(Surface([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]]))
    x = np.arange(-0.3, 0.3, SPACING)
    z = TIP + cap_height(x, 0.65e-3, 0.325e-3, TIP) + 2e-4 * np.random.default_rng(0).standard_normal(len(x))
    centers = np.column_stack([x, np.zeros_like(x), z])

    def feed(count: int) -> int:
        online = OnlineDetector(base, TIP, SPACING, Noise(2e-4))
        return sum(len(online.push(1.0 + k / 5000.0, center)) for k, center in enumerate(centers[:count]))

    # compilation and the threshold are paid for once
    feed(10_000)
    begin = process_time()
    assert feed(len(x)) == 1
    assert (process_time() - begin) / len(x) < 50e-6
