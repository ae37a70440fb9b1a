"""The bench of profiles: what it counts, and one profile of each kind of detail."""

from __future__ import annotations

import pytest

from explore3d.bench.precision import FIRST_REPORTED, bench_profiles, profile_trial
from explore3d.bench.precision.profiles import ROW_PITCH, raster_trial


@pytest.mark.parametrize("name", ["slot", "scratch with burrs", "step", "bare"])
def test_what_is_on_a_profile_is_found(name: str) -> None:
    found, wanted = profile_trial(name, 1)
    assert [feature.kind for feature in found] == [kind for kind, _, _ in wanted]
    for feature, (_, height, _) in zip(found, wanted, strict=True):
        assert abs(feature.height.median) == pytest.approx(abs(height), rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["faint scratch", *(pytest.param(name, marks=pytest.mark.slow) for name in ("slot", "hump"))]
)
def test_what_crosses_a_raster_is_found(name: str) -> None:
    found, wanted, length = raster_trial(name, 1, 16)
    assert [feature.kind for feature in found] == [kind for kind, _, _ in wanted]
    assert abs(found[0].height.median) == pytest.approx(abs(wanted[0][1]), rel=0.08)
    assert abs(found[0].length.median - length) < ROW_PITCH


def test_a_line_counts_sizes_within_their_intervals() -> None:
    head, line = bench_profiles(["hump"], range(2))
    assert head.split(",")[:3] == ["form", "profiles", "right"]
    name, profiles, right, heights, inside, *_ = line.split(",")
    assert (name, profiles, right, heights) == ("hump", "2", "2", "2") and 0 <= int(inside) <= 2


def test_reported_seeds_are_others_than_those_built_with() -> None:
    assert FIRST_REPORTED > 100
