"""Bodies of planes and arcs along a straight line, felt without a mesh: fillets, edges, corners, gutters."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray, Trace
from mapping.base import Base, fit_base
from mapping.geometry.templates import step_height

TIP, NOISE, HALF = 0.01, 2e-5, 0.03


def path_over(bends: list[tuple[float, float, float]], begin: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Places p and heights q of the section of a ball's path, by its arc length: lines, and arcs of bends (place
    along the path, turn in radians, radius of the path there).

    Args:
        bends: of the section.
        begin: angle of the first line, rad.
    """
    s = np.linspace(-1.6 * HALF, 1.6 * HALF, 40001)
    angle = np.full_like(s, begin)
    for place, turn, radius in bends:
        long = max(abs(turn) * radius, 1e-9)
        angle += turn * np.clip((s - place) / long + 0.5, 0.0, 1.0)
    step = float(np.diff(s).mean())
    return np.cumsum(np.cos(angle)) * step, np.cumsum(np.sin(angle)) * step


def felt(section: tuple[FloatArray, FloatArray], turn: float, wire: float = 0.0, seed: int = 0) -> Trace:
    """Rows over a section swept along a line at an angle to them; with a wire's crest of a height (m) along it."""
    p, q = section[0] - section[0].mean(), section[1] - section[1].mean()
    run, rows = np.linspace(-HALF, HALF, 1500), np.arange(-HALF, HALF, 3e-3) + 1e-3
    x, y = np.tile(run, len(rows)), np.repeat(rows, len(run))
    across, along = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
    heights = np.interp(across, p, q)
    crest = np.maximum(wire - (across - 0.012) ** 2 / (2.0 * TIP), 0.0)
    heights += np.where(np.abs(along) < 0.012, crest, 0.0)
    z = heights + NOISE * np.random.default_rng(seed).standard_normal(len(x))
    sweep = np.repeat(np.arange(len(rows)), len(run))
    return Trace(2e-4 * np.arange(float(len(x))), np.column_stack([x, y, z]), sweep, TIP)


def missed(base: Base, trace: Trace, section: tuple[FloatArray, FloatArray], turn: float) -> float:
    """Largest height over the base of centres on the bare path, m."""
    p, q = section[0] - section[0].mean(), section[1] - section[1].mean()
    x, y, _ = trace.centers[::7].T
    bare = np.interp(np.cos(turn) * x + np.sin(turn) * y, p, q)
    return float(np.abs(base.foot(np.column_stack([x, y, bare]), TIP).height).max())


# a path's arc over a sharp edge has the tip's radius, a corner's none
BODIES = {
    "fillet": ([(0.0, 1.0, 0.02)], -0.5),
    "sharp edge": ([(0.004, -0.7, TIP)], 0.35),
    "corner": ([(-0.003, 0.8, 0.0)], -0.4),
    "roof": ([(-0.011, 0.55, 0.0), (0.0, -1.0, TIP), (0.011, 0.6, 0.0)], -0.1),
    "gutter": ([(-0.016, -0.6, 0.014), (-0.006, 0.6, 0.004), (0.006, 0.6, 0.004), (0.016, -0.5, 0.014)], 0.0),
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name == "roof" else ()) for name in BODIES]
)
def test_a_section_along_a_line_is_found_to_the_noise_of_its_mean(name: str) -> None:
    bends, begin = BODIES[name]
    section = path_over(bends, begin)
    trace = felt(section, 0.3)
    base = fit_base(trace, tested=False)
    assert base.kind == "extrusion"
    assert len(base.parameters["turns"]) == len(bends)
    # 30,000 samples of 20 um know each of a few parameters to a quarter of a micrometre
    assert missed(base, trace, section, 0.3) < 3e-6


def test_radius_and_line_of_a_fillet_are_told() -> None:
    base = fit_base(felt(path_over([(0.0, 1.0, 0.02)], -0.5), 0.3), tested=False)
    assert base.parameters["radii"] == pytest.approx([0.02 + TIP], rel=0.01)
    assert np.abs(np.array(base.parameters["axis"]) @ [-np.sin(0.3), np.cos(0.3), 0.0]) == pytest.approx(1.0, abs=1e-6)


def test_a_wire_along_a_fillet_is_no_bend() -> None:
    section = path_over([(0.0, 1.0, 0.02)], -0.5)
    trace = felt(section, 0.3, wire=0.6e-3)
    base = fit_base(trace, tested=False)
    assert base.kind == "extrusion" and len(base.parameters["turns"]) == 1
    assert missed(base, trace, section, 0.3) < 3e-6


def test_a_corner_is_drawn_on_until_its_sides_meet() -> None:
    bends, begin = BODIES["corner"]
    base = fit_base(felt(path_over(bends, begin), 0.3), tested=False)
    assert base.parameters["radii"] == [0.0]
    (middle,) = np.array(base.parameters["middles"])
    # the ball in it touches both sides, the corner lies deeper by a share of its radius
    deep = middle - [0.0, 0.0, TIP / np.cos(0.4)]
    assert base.nearest.query(deep[None]).distance[0] < 1e-5


def test_a_ridge_across_all_of_a_plate_stays_a_detail_on_it() -> None:
    flat = path_over([], 0.0)
    trace = felt(flat, 0.3)
    crest = np.maximum(0.6e-3 - trace.centers[:, 0] ** 2 / (2.0 * TIP), 0.0)
    ridged = Trace(trace.t, trace.centers + crest[:, None] * [0.0, 0.0, 1.0], trace.sweep, TIP)
    assert fit_base(ridged).kind == "plane"


def test_a_rail_between_ends_on_one_plane_stays_a_detail_on_it() -> None:
    """As rails are bodies' sections too, every wire and every step that all rows cross would be one."""
    bends = [(-0.016, 0.6, 0.004), (-0.006, -0.6, 0.014), (0.006, -0.6, 0.014), (0.016, 0.6, 0.004)]
    assert fit_base(felt(path_over(bends), 0.3)).kind == "plane"


@pytest.mark.parametrize(("height", "turn"), [(2e-3, 0.3), pytest.param(5e-3, 0.0, marks=pytest.mark.slow)])
def test_a_step_is_a_detail_upon_a_plane_and_no_bent_body(height: float, turn: float) -> None:
    p = np.linspace(-1.6 * HALF, 1.6 * HALF, 40001)
    base = fit_base(felt((p, step_height(p, height, TIP)), turn))
    assert base.kind == "plane"
    assert np.ptp(base.levels) == pytest.approx(height, rel=1e-2)


def test_stairs_felt_in_cells_as_long_as_their_arcs_are_no_bent_body() -> None:
    """A cell's mean is on its way up as soon as one of its samples is: climbs are wider by a cell than the ball's."""
    x, tip, rng = 60e-6 * np.arange(667), 0.5e-3, np.random.default_rng(9)
    felt_once = step_height(x - 12e-3, 0.3e-3, tip) + step_height(x - 25e-3, 0.2e-3, tip)
    rows = [np.column_stack([x, np.full(len(x), 1e-3 * k), felt_once]) for k in range(16)]
    centers = np.concatenate(rows) + tip * np.array([0.0, 0.0, 1.0])
    centers[:, 2] += 1e-6 * rng.standard_normal(len(centers))
    base = fit_base(Trace(np.arange(len(centers)) * 1.0, centers, np.repeat(np.arange(16), len(x)), tip))
    assert base.kind == "plane" and np.sort(np.abs(base.levels)) == pytest.approx([0.0, 0.2e-3, 0.5e-3], abs=2e-6)
