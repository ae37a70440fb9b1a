"""The lateral modes of a course, and their slopes."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.inference.curves import CurveModes


@pytest.mark.parametrize("closed", [False, True])
def test_slopes_are_the_modes_change_along_the_chart(closed: bool) -> None:
    modes = CurveModes(3, 5e-3, 20e-3, closed)
    s, step = np.linspace(-30e-3, 40e-3, 57), 1e-8
    change = (modes.basis(s + step) - modes.basis(s - step)) / (2.0 * step)
    np.testing.assert_allclose(modes.slopes(s), change, rtol=1e-5, atol=1e-4)
    assert np.abs(change[1:]).max() > 0.5
