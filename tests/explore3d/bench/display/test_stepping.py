"""The time of a display's step, by the clock."""

from __future__ import annotations

import pytest

from explore3d.bench.display import bench_stepping, stepping_body, stepping_lines


@pytest.mark.slow
def test_the_body_is_as_large_as_asked_and_the_clock_is_kept() -> None:
    body = stepping_body()
    assert len(body.parts) == 20 and len(body.base.surface.faces) == 20_000
    (found,) = bench_stepping([1000.0], 0.3)
    assert found.rate == 1000.0 and 0.0 < found.achieved < 1010.0 and found.touching > 0.2
    for median, most, largest in (found.computing, found.late):
        assert 0.0 <= median <= most <= largest
    assert 0.0 <= found.missed <= 1.0 and found.computing[0] > 0.0
    assert len(list(stepping_lines([found]))) == 3
