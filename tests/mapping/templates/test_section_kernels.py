"""Lines with a polygon for a section: their traces against dilation by brute force."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray
from mapping.geometry.templates import section_heights, step_height


def trace(
    u: FloatArray,
    s: FloatArray,
    corners: list[tuple[float, float]],
    tip: float,
    bend: float = 0.0,
    rounded: float = 0.0,
    shoulder: float = 0.0,
) -> FloatArray:
    """Heights at distances u across and s along a line that ends at s = 0."""
    across, up = (np.array([each]) for each in zip(*corners, strict=True))
    out = np.empty((1, len(u)))
    nodes = np.zeros((2, 0, len(u), 1))
    ends, radius = np.array([[-1.0, 0.0]]), np.array([rounded])
    section_heights(
        s[:, None],
        u[:, None],
        nodes,
        *(np.full((len(u), 1), bend),) * 2,
        np.zeros((1, 0)),
        ends,
        radius,
        across,
        up,
        np.array([shoulder]),
        tip,
        out,
    )
    return np.asarray(out[0])


def places_between(low: float, high: float, count: int) -> FloatArray:
    return np.linspace(low, high, count if high > low else 1)


def dilated(u: FloatArray, s: FloatArray, corners: list[tuple[float, float]], tip: float, rounded: float) -> FloatArray:
    """The same by trying all points of the body: of its top, its sides, its end, and the corners between them."""
    x, z = zip(*corners, strict=True)
    core = x[0] - rounded
    away = np.unique(np.concatenate([np.linspace(0.0, x[-1] - core, 161), np.subtract(x, core)]))
    turns = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 181)
    radial, turn = (each.ravel() for each in np.meshgrid(away, turns, indexing="ij"))
    middle = core * np.sign(np.sin(turn))
    across, along = middle + radial * np.sin(turn), radial * np.cos(turn) - rounded
    end = [each.ravel() for each in np.meshgrid(places_between(-core, core, 41), away)]
    sides = [each.ravel() for each in np.meshgrid(np.linspace(-4e-3, -rounded, 201), away)]
    inner = [each.ravel() for each in np.meshgrid(places_between(-core, core, 201), np.linspace(-4e-3, -rounded, 201))]
    places = np.concatenate(
        [
            np.column_stack([*inner, 0.0 * inner[0]]),
            np.column_stack([across, along, radial]),
            np.column_stack([end[0], end[1] - rounded, end[1]]),
            *(np.column_stack([side * (core + sides[1]), sides[0], sides[1]]) for side in (-1.0, 1.0)),
        ]
    )
    heights = np.interp(core + places[:, 2], x, z)
    across, along = np.ascontiguousarray(places[:, 0]), np.ascontiguousarray(places[:, 1])
    return np.array([held(heights, (x - across) ** 2 + (y - along) ** 2, tip) for x, y in zip(u, s, strict=True)])


def held(heights: FloatArray, gap: FloatArray, tip: float) -> float:
    """How high points of given heights, at squared distances, hold the ball up over the plane."""
    near = gap < tip**2
    gap = gap[near]
    return max(0.0, float((heights[near] - gap / (tip + np.sqrt(tip**2 - gap))).max(initial=0.0)))


@pytest.mark.parametrize(
    "corners",
    [
        pytest.param([(1e-3, 0.4e-3), (1.001e-3, 0.0)], id="a bar"),
        pytest.param([(0.0, 0.5e-3), (0.4e-3, 0.0)], id="a steep roof"),
        pytest.param([(0.0, 0.1e-3), (1.5e-3, 0.0)], id="a roof that the ball rolls down on"),
        pytest.param([(0.2e-3, 0.4e-3), (0.5e-3, 0.3e-3), (2.0e-3, 0.0)], id="two slopes"),
    ],
)
@pytest.mark.parametrize("tip", [10e-3, 1e-3])
@pytest.mark.parametrize("beyond", [-0.5e-3, 0.0, 0.4e-3])
@pytest.mark.parametrize("rounding", [0.0, 0.6, 1.0])
def test_the_ball_rests_on_what_holds_it_highest(
    corners: list[tuple[float, float]], tip: float, beyond: float, rounding: float
) -> None:
    half, rounded = np.linspace(0.0, 4e-3, 41), rounding * corners[0][0]
    u = np.concatenate([-half[:0:-1], half])
    felt = trace(u, np.full(81, beyond), corners, tip, rounded=rounded)
    on_one_side = dilated(half, np.full(41, beyond), corners, tip, rounded)  # the body is its own mirror image
    # the points miss the highest one by up to 10 um along an outline, 8 um round a corner, and 7 um down a flank
    np.testing.assert_allclose(felt, np.concatenate([on_one_side[:0:-1], on_one_side]), atol=3e-6)


def test_beyond_its_end_a_wide_bar_is_a_step() -> None:
    s = np.linspace(-1e-3, 4e-3, 51)
    bar = trace(np.zeros(len(s)), s, [(20e-3, 0.5e-3), (20.1e-3, 0.0)], 10e-3)
    np.testing.assert_allclose(bar, step_height(-s, 0.5e-3, 10e-3), atol=1e-15)


def test_it_scales_with_the_unit_of_length() -> None:
    u = np.linspace(-4e-3, 4e-3, 101)
    corners = [(0.2e-3, 0.4e-3), (0.5e-3, 0.3e-3), (2.0e-3, 0.0)]
    scaled = [(2.0**-20 * x, 2.0**-20 * z) for x, z in corners]
    small = trace(2.0**-20 * u, 0.0 * u, scaled, 2.0**-20 * 10e-3)
    np.testing.assert_array_equal(small, 2.0**-20 * trace(u, 0.0 * u, corners, 10e-3))


@pytest.mark.parametrize("heading", [-0.3, 0.1])
def test_a_line_that_runs_at_an_angle_to_its_chart_is_felt_as_along_it(heading: float) -> None:
    rng = np.random.default_rng(0)
    s, u = rng.uniform(-6e-3, 6e-3, 2000), rng.uniform(-5e-3, 5e-3, 2000)
    corners = [(1e-3, 0.4e-3), (1.5e-3, 0.0)]
    # the same places about a chart that is turned about the line's end, and has the line's course as its heading
    cos, sin = 1.0 / np.hypot(1.0, heading), heading / np.hypot(1.0, heading)
    place, aside = cos * s - sin * u, sin * s + cos * u
    basis = np.array([place, np.ones(len(s))])[:, None, :, None]
    out, flat = np.empty((1, len(s))), np.zeros((len(s), 1))
    across, up = (np.array([each]) for each in zip(*corners, strict=True))
    ends, course = np.array([[-1.0, 0.0]]), np.array([[heading]])
    section_heights(
        place[:, None],
        aside[:, None],
        basis,
        flat,
        flat,
        course,
        ends,
        np.zeros(1),
        across,
        up,
        np.zeros(1),
        10e-3,
        out,
    )
    straight = trace(u, s, corners, 10e-3)
    np.testing.assert_allclose(out[0], straight, atol=1e-15)
    beyond = (s > 0.0) & (straight > 0.0)
    assert (np.abs(u[beyond]) > 0.5e-3).sum() > 100


@pytest.mark.parametrize(("shoulder", "tip"), [(0.2e-3, 1e-3), (0.2e-3, 10e-3), (0.4e-3, 3e-3), (2e-3, 10e-3)])
def test_round_edges_are_felt_as_the_arcs_that_they_are(shoulder: float, tip: float) -> None:
    """A bar 0.4 mm high with a flat top of 1 mm, by trying all points of its section."""
    u = np.linspace(0.0, 5e-3, 301)
    turn = np.linspace(0.0, np.arccos(max(1.0 - 0.4e-3 / shoulder, 0.0)), 4001)
    across = np.concatenate([np.linspace(0.0, 0.5e-3, 1001), 0.5e-3 + shoulder * np.sin(turn)])
    up = np.concatenate([np.full(1001, 0.4e-3), 0.4e-3 - shoulder * (1.0 - np.cos(turn))])
    gap = across - u[:, None]
    rest = np.where(np.abs(gap) < tip, up + np.sqrt(np.maximum(tip**2 - gap**2, 0.0)) - tip, 0.0).max(axis=1)
    felt = trace(u, np.full_like(u, -0.5), [(0.5e-3, 0.4e-3)], tip, shoulder=shoulder)
    np.testing.assert_allclose(felt, np.maximum(rest, 0.0), atol=1e-9)


def test_lines_of_a_batch_are_felt_as_each_alone_to_the_last_bit() -> None:
    """Bins that none of a batch reaches are left out of it: one line far aside must not take another's."""
    rng, count = np.random.default_rng(7), 400
    s, lateral = np.sort(rng.uniform(-10e-3, 10e-3, (count, 2)), axis=0), rng.uniform(-8e-3, 8e-3, (count, 2))
    basis = np.stack([np.stack([np.ones_like(s), s]), np.stack([np.zeros_like(s), np.ones_like(s)])])
    bends = np.full((2, count, 2), 5.0)
    courses = np.array([[0.0, 0.1], [5e-3, -0.2], [-6e-3, 0.0]])
    ends = np.array([[-5e-3, 5e-3], [-9e-3, 0.0], [2e-3, 8e-3]])
    half, height = np.array([0.5e-3, 0.0, 1e-3]), np.array([0.3e-3, 0.5e-3, 0.1e-3])
    section = 0.5 * half, np.stack([half, half + 0.4e-3], axis=1), np.stack([height, np.zeros(3)], axis=1), 0.1 * height
    together, alone = np.empty((3, count)), np.empty((3, count))
    section_heights(s, lateral, basis, *bends, courses, ends, *section, 4e-3, together)
    for w in range(3):
        own = (each[w : w + 1] for each in (courses, ends, *section))
        section_heights(s, lateral, basis, *bends, *own, 4e-3, alone[w : w + 1])
    assert np.array_equal(together, alone)
    assert ((together > 0.0).sum(axis=1) > 20).all()
