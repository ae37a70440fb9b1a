"""The proxy against closed forms: its path, its force, and that nothing makes it sink in."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest

from mapping import ContactError, FloatArray, Surface
from mapping.geometry.proxy import Bar, Bell, Chain, Part, Proxy, ProxyBody, Swell, Terrace, Trench
from mapping.geometry.templates import (
    BumpOfRevolution,
    cap_height,
    chain_height,
    groove_height,
    rim_height,
    section_heights,
    smooth_point_heights,
    step_height,
)
from mapping.inference.families import width_at_half_height

UP = np.array([0.0, 0.0, 1.0])
PLATE = Surface(0.05 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]])
TIPS = (0.3e-3, 1e-3, 5e-3, 10e-3)
# r of the centre, in the plane y = 0 or at (x, y): height over the plate's own trace
Form = Callable[[FloatArray, FloatArray, float], FloatArray]


def along(*points: tuple[float, float, float]) -> tuple[FloatArray, FloatArray]:
    axis = np.array(points)
    return axis, np.broadcast_to(UP, axis.shape)


LINE, POINT = along((0, -20e-3, 0), (0, 20e-3, 0)), along((0, 0, 0))
CROSS = along((-20e-3, 0, 0), (20e-3, 0, 0))


def junction_height(x: FloatArray, y: FloatArray, r: float) -> FloatArray:
    feet = np.column_stack([x, y, np.zeros_like(x)])
    normals = np.broadcast_to(UP, feet.shape)
    drop = (0.2e-3 - 0.15e-3) * UP
    return np.maximum(
        chain_height(feet, normals, LINE[0] + drop, 0.15e-3, r),
        chain_height(feet, normals, CROSS[0] + drop, 0.15e-3, r),
    )


def bell_form(scale: float, exponent: float) -> Form:
    """A bell 0.2 mm high."""

    def form(x: FloatArray, y: FloatArray, r: float) -> FloatArray:
        out = np.empty((1, len(x)))
        half = 0.5 * float(width_at_half_height(scale, exponent))
        size = [np.array([each]) for each in (0.2e-3, half, 1.0 / exponent)]
        smooth_point_heights(np.c_[x], np.c_[y], np.zeros(2), np.zeros((1, 2)), *size, r, out)
        return np.asarray(out[0])

    return form


def bar_form(top: float, run: float) -> Form:
    """A section with a flat top and straight flanks, 0.2 mm high."""

    def form(x: FloatArray, y: FloatArray, r: float) -> FloatArray:
        nothing, out = np.zeros((len(x), 1)), np.empty((1, len(x)))
        corners = np.array([[0.5 * top, 0.5 * top + run]]), np.array([[0.2e-3, 0.0]])
        section_heights(
            nothing, np.c_[x], np.zeros((2, 0, len(x), 1)), nothing, nothing, np.zeros((1, 0)),
            np.array([[-1e300, 1e300]]), np.zeros(1), *corners, np.zeros(1), r, out,
        )  # fmt: skip
        return np.asarray(out[0])

    return form


CASES: dict[str, tuple[tuple[Part, ...], Form]] = {
    "ridge": ((Chain(*LINE, 0.2e-3, 0.15e-3),), lambda x, y, r: cap_height(x, 0.2e-3, 0.15e-3, r)),
    "low ridge": ((Chain(*LINE, 0.05e-3, 2e-3),), lambda x, y, r: cap_height(x, 0.05e-3, 2e-3, r)),
    "bump": ((Chain(*POINT, 0.2e-3, 0.2e-3),), lambda x, y, r: cap_height(np.hypot(x, y), 0.2e-3, 0.2e-3, r)),
    "bell": ((Bell(np.zeros(3), UP, 0.2e-3, 0.6e-3, 2.0),), bell_form(0.6e-3, 2.0)),
    "cosine bell": ((Bell(np.zeros(3), UP, 0.2e-3, 0.6e-3, -2.5),), bell_form(0.6e-3, -2.5)),
    "swell": ((Swell(*LINE, 0.2e-3, 0.6e-3, -2.5),), lambda x, y, r: bell_form(0.6e-3, -2.5)(x, 0.0 * y, r)),
    "bar": ((Bar(*LINE, 0.2e-3, 0.8e-3, 0.0),), bar_form(0.8e-3, 0.0)),
    "roof": ((Bar(*LINE, 0.2e-3, 0.0, 1.2e-3),), bar_form(0.0, 1.2e-3)),
    "trapezoid": ((Bar(*LINE, 0.2e-3, 0.7e-3, 0.5e-3),), bar_form(0.7e-3, 0.5e-3)),
    "disc": ((Bar(*POINT, 0.2e-3, 0.8e-3, 0.0),), lambda x, y, r: bar_form(0.8e-3, 0.0)(np.hypot(x, y), 0.0 * y, r)),
    "frustum": (
        (Bar(*POINT, 0.2e-3, 0.7e-3, 0.5e-3),),
        lambda x, y, r: bar_form(0.7e-3, 0.5e-3)(np.hypot(x, y), 0.0 * y, r),
    ),
    "groove": ((Trench(*LINE, 1e-3, 0.1e-3),), lambda x, y, r: groove_height(x, 1e-3, r, 0.1e-3)),
    "pit": ((Trench(*POINT, 1.5e-3, 0.1e-3),), lambda x, y, r: rim_height(0.75e-3 - np.hypot(x, y), r, 0.1e-3)),
    "step": ((Terrace(*LINE, 0.2e-3, -1.0),), lambda x, y, r: step_height(x, 0.2e-3, r)),
    "junction": ((Chain(*LINE, 0.2e-3, 0.15e-3), Chain(*CROSS, 0.2e-3, 0.15e-3)), junction_height),
}


def crossing(form: Form, r: float, way: float, y: float, press: float, count: int = 1500) -> FloatArray:
    """A device that crosses at a depth below the closed form."""
    x = way * np.linspace(-4.5e-3, 4.5e-3, count)
    beside = np.full_like(x, y)
    return np.column_stack([x, beside, r - press + form(x, beside, r)])


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("r", TIPS)
def test_the_path_over_a_feature_is_its_closed_form(name: str, r: float) -> None:
    parts, form = CASES[name]
    body = ProxyBody(PLATE, parts, r)
    for way in (1.0, -1.0):
        for y in (0.0, 0.3e-3):
            felt = Proxy(body).follow(crossing(form, r, way, y, 0.02e-3))
            assert felt.touching.all()
            x, beside, z = felt.centers.T
            assert np.abs(z - r - form(x, beside, r)).max() < 1e-6
            # it goes everywhere along: no piece of the path is left out but what the kinks cast aside
            assert np.abs(x - felt.device[:, 0]).max() < 0.1e-3


# the flanks of a swell, and of what is turned, are facets, each straight: the path is true to what their chords miss,
# the slope steps
@pytest.mark.parametrize("name", [n for n in CASES if "bell" not in n and n not in ("swell", "disc", "frustum")])
@pytest.mark.parametrize("r", TIPS)
def test_lateral_over_normal_force_is_the_slope(name: str, r: float) -> None:
    parts, form = CASES[name]
    body = ProxyBody(PLATE, parts, r)
    h = 1e-5 * r
    for y in (0.0, 0.3e-3):
        felt = Proxy(body).follow(crossing(form, r, 1.0, y, 0.05e-3))
        force = felt.force(500.0)
        x, beside, _ = felt.centers.T
        smooth = np.ones(len(x), dtype=bool)
        wrong = []
        for lateral, dx, dy in ((0, h, 0.0), (1, 0.0, h)):
            here = form(x, beside, r)
            left, right = (here - form(x - dx, beside - dy, r)) / h, (form(x + dx, beside + dy, r) - here) / h
            slope = 0.5 * (left + right)
            # away from kinks, where the slope has two values, and both walls push
            smooth &= np.abs(left - right) < 5e-3 + 4.0 * h / r
            off = np.abs(-force[:, lateral] / force[:, 2] - slope)
            wrong.append(off > 0.01 * np.abs(slope) + 1e-6)
        assert smooth.mean() > 0.9
        assert not (wrong[0] | wrong[1])[smooth].any()


@pytest.mark.parametrize("r", TIPS[:2])
def test_over_a_bell_the_force_is_along_its_normal(r: float) -> None:
    parts, form = CASES["bell"]
    felt = Proxy(ProxyBody(PLATE, parts, r)).follow(crossing(form, r, 1.0, 0.0, 0.05e-3))
    force = felt.force(500.0)
    u = np.linspace(0.0, 5e-3, 500_001)
    base = 1.0 + (u / 0.6e-3) ** 2 / 2.0
    slope = -2.0 * 0.2e-3 * base**-2.0 * u / (0.6e-3**2 * base)
    parallel = u - r * slope / np.hypot(1.0, slope)  # it folds under larger tips
    x = felt.centers[:, 0]
    there = np.interp(np.abs(x), parallel, slope) * np.sign(x)
    assert np.abs(-force[:, 0] / force[:, 2] - there).max() < 1e-6


@pytest.mark.parametrize(
    "name", ["ridge", "bar", "roof", "trapezoid", "bump", "bell", "step", "groove", "pit", "junction"]
)
def test_the_force_jumps_nowhere_by_more_than_people_notice(name: str) -> None:
    parts, _ = CASES[name]
    for r in TIPS:
        x = np.linspace(-4.5e-3, 4.5e-3, 9000)  # 1 um a step: 1 mm/s at 1 kHz, 10 mm/s at 10 kHz
        # below the floor of hollows; pressed in beyond its own radius the ball slips off an edge, as real ones do
        press = 0.12e-3 if name in ("groove", "pit") or r > 0.3e-3 else 0.08e-3
        device = np.column_stack([x, np.zeros_like(x), np.full_like(x, r - press)])
        felt = Proxy(ProxyBody(PLATE, parts, r)).follow(device)
        force = felt.force(500.0)
        jump = np.linalg.norm(np.diff(force, axis=0), axis=1) / np.linalg.norm(force, axis=1)[1:]
        assert jump.max() < 0.07


@pytest.mark.parametrize("end", [-1.0, 1.0])
@pytest.mark.parametrize(("height", "radius"), [(0.2e-3, 0.1e-3), (0.3e-3, 0.2e-3), (0.1e-3, 1e-3)])
def test_a_ridge_ends_between_square_and_round(end: float, height: float, radius: float) -> None:
    r, half = 5e-3, 10e-3
    body = ProxyBody(PLATE, (Chain(*along((-half, 0.0, 0.0), (half, 0.0, 0.0)), height, radius),), r)
    x = np.linspace(-1e-3, 3e-3, 801)  # beyond the end
    device = np.column_stack([end * (half + x), np.zeros_like(x), np.full_like(x, r - 1e-6)])
    felt = Proxy(body).follow(np.vstack([[[end * half, 0.0, 2.0 * r]], device])).centers[1:]
    off = end * felt[:, 0] - half
    whole = r + 0.5 * radius
    fall = whole - np.sqrt(whole**2 - np.maximum(off, 0.0) ** 2)
    assert np.abs(felt[:, 2] - r - np.maximum(height - fall, 0.0)).max() < 1e-9


@pytest.mark.slow
def test_random_jumps_never_bring_it_inside() -> None:
    bump = BumpOfRevolution(15.0).mesh(3.0, rings=40, sectors=60)
    body = Surface(1e-3 * bump.vertices, bump.faces)
    groove = along((1.5e-3, -1e-3, 0.02e-3), (1.5e-3, 1e-3, 0.01e-3))
    parts = (Trench(*groove, 0.4e-3, 0.1e-3), Chain(*POINT, 1.2e-3, 0.1e-3))
    r = 0.5e-3
    jumps = 4e-3 * np.random.default_rng(0).standard_normal((20_000, 3))
    built = ProxyBody(body, parts, r)
    proxy = Proxy(built)
    felt = proxy.follow(np.vstack([[[0.0, 0.0, 5e-3]], jumps]))
    assert np.isfinite(felt.centers).all()
    assert built.gaps(felt.centers, r).min() > -1e-9 * r


def test_a_skirt_that_bends_towards_the_ball_lets_it_in_nowhere() -> None:
    r, rng = 0.3e-3, np.random.default_rng(11)
    body = ProxyBody(PLATE, (Bell(np.zeros(3), UP, 3e-3, 0.5e-3, 1.0),), r)
    jumps = rng.uniform([-6e-3, -6e-3, -2e-3], [6e-3, 6e-3, 6e-3], (4000, 3))
    felt = Proxy(body).follow(np.vstack([[[0.0, 0.0, 20e-3]], jumps]))
    assert body.gaps(felt.centers, r).min() > -1e-9 * r


def test_friction_holds_within_its_cone_and_slips_on_its_border() -> None:
    body = ProxyBody(PLATE, (), 1e-3)
    lateral = np.concatenate([np.linspace(0, 0.04e-3, 50), np.linspace(0.04e-3, 1e-3, 500)])
    device = np.column_stack([lateral, np.zeros_like(lateral), np.full_like(lateral, 1e-3 - 0.1e-3)])
    start = np.array([[0.0, 0.0, 1.5e-3], [0.0, 0.0, 0.9e-3]])
    felt = Proxy(body, friction=0.5).follow(np.vstack([start, device]))
    force = felt.force(1.0)[2:]
    ratio = -force[:, 0] / force[:, 2]
    stays = lateral < 0.05e-3
    assert np.allclose(felt.centers[2:][stays, 0], 0.0, atol=1e-12)
    assert ratio.max() < 0.5 + 1e-6
    assert np.allclose(ratio[lateral > 0.06e-3], 0.5, atol=1e-3)


def test_it_does_not_pass_a_wall_however_far_the_device_jumps() -> None:
    low, high = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * 10e-3, np.array([0.0, 0.0, 1e-6])
    box = Surface(
        np.vstack([low, low - high]),
        [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6], [0, 4, 5], [0, 5, 1], [1, 5, 6], [1, 6, 2], [2, 6, 7], [2, 7, 3],
         [3, 7, 4], [3, 4, 0]],
    )  # fmt: skip
    felt = Proxy(ProxyBody(box, (), 1e-3)).follow([[0.0, 0.0, 5e-3], [0.0, 0.0, -8e-3], [1e-3, 0.0, -8e-3]])
    assert np.allclose(felt.centers[1:, 2], 1e-3, atol=1e-12)


@pytest.mark.parametrize(
    ("part", "message"),
    [
        (Chain(*LINE, 0.0, 1e-3), "height must be positive"),
        (Trench(*LINE, np.nan, 1e-3), "width must be positive"),
        (Bar(*LINE, 1e-3, 0.0, 0.0), "both 0"),
        (Bar(*LINE, 1e-3, -1e-3, 0.0), "top must be finite and at least 0"),
        (Swell(*POINT, 1e-3, 1e-3, 2.0), "two points at least"),
        (Terrace(*POINT, 1e-3, 1.0), "needs two ends"),
        (Chain(LINE[0], LINE[1][:1], 1e-3, 1e-3), "of one shape"),
    ],
)
def test_sizes_that_nothing_has_are_refused(part: Part, message: str) -> None:
    with pytest.raises(ContactError, match=message):
        ProxyBody(PLATE, (part,), 1e-3)


def test_bad_balls_places_and_friction_are_refused() -> None:
    with pytest.raises(ContactError, match="radius must be a positive"):
        ProxyBody(PLATE, (), 0.0)
    body = ProxyBody(PLATE, (), 1e-3)
    with pytest.raises(ContactError, match="friction"):
        Proxy(body, -0.1)
    with pytest.raises(ContactError, match="finite and of shape"):
        Proxy(body).follow([[0.0, 0.0, np.nan]])
    assert len(Proxy(body).follow(np.zeros((0, 3))).centers) == 0


def test_a_groove_ends_square_where_its_axis_ends() -> None:
    body = ProxyBody(PLATE, (Trench(*LINE, 1e-3, 0.1e-3),), 5e-3)
    y = np.linspace(15e-3, 24e-3, 1500)
    rim = 20e-3 - y
    form = rim_height(np.minimum(rim, 0.5e-3), 5e-3, 0.1e-3)
    device = np.column_stack([np.zeros_like(y), y, 5e-3 - 0.02e-3 + form])
    felt = Proxy(body).follow(device)
    _, place, z = felt.centers.T
    assert np.abs(z - 5e-3 - rim_height(np.minimum(20e-3 - place, 0.5e-3), 5e-3, 0.1e-3)).max() < 1e-6


def crossing_grooves(shallow: float, deep: float) -> tuple[tuple[Part, ...], Form]:
    """A groove along y, 1 mm wide, and a deeper one along x, 2 mm wide."""
    first, second = Trench(*LINE, 1e-3, shallow), Trench(*CROSS, 2e-3, deep)

    def form(x: FloatArray, y: FloatArray, r: float) -> FloatArray:
        beside, past = 0.5e-3 - np.abs(x), 1e-3 - np.abs(y)  # how far from the walls, inside of each groove
        land = np.where((beside > 0.0) & (past > 0.0), np.hypot(beside, past), np.maximum(beside, past))
        floor = np.where(beside < 0.0, np.hypot(np.maximum(past, 0.0), beside), past)
        return np.maximum(rim_height(land, r, deep), rim_height(floor, r, deep - shallow) - shallow)

    return (first, second), form


@pytest.mark.parametrize("depths", [(0.02e-3, 0.1e-3), (0.1e-3, 0.1e-3)])
@pytest.mark.parametrize("r", TIPS)
def test_where_grooves_cross_the_deeper_one_counts(depths: tuple[float, float], r: float) -> None:
    parts, form = crossing_grooves(*depths)
    way = 1e-3 * np.array([[-3.0, -3.0], [0.1, 0.05], [0.05, 3.0], [0.4, 0.8], [3.0, 0.3], [0.2, 0.1], [0.45, -3.0]])
    places = np.concatenate([a + np.linspace(0, 1, 500)[:, None] * (b - a) for a, b in itertools.pairwise(way)])
    for order in (parts, parts[::-1]):
        x, y = places.T
        felt = Proxy(ProxyBody(PLATE, order, r)).follow(np.column_stack([x, y, r - 1e-6 + form(x, y, r)]))
        x, y, z = felt.centers.T
        assert felt.touching.all()
        assert np.abs(z - r - form(x, y, r)).max() < 1e-8
        assert np.hypot(x - places[:, 0], y - places[:, 1]).max() < 0.02e-3


def test_a_pit_in_a_groove_goes_on_from_its_floor() -> None:
    parts = (Trench(*LINE, 3e-3, 0.05e-3), Trench(*POINT, 2e-3, 0.12e-3))
    y, r = np.linspace(-4e-3, 4e-3, 2000), 1e-3
    form = rim_height(1e-3 - np.abs(y), r, 0.07e-3) - 0.05e-3
    felt = Proxy(ProxyBody(PLATE, parts, r)).follow(np.column_stack([np.zeros_like(y), y, r - 1e-6 + form]))
    _, place, z = felt.centers.T
    assert np.abs(z - r - rim_height(1e-3 - np.abs(place), r, 0.07e-3) + 0.05e-3).max() < 1e-6


def test_a_bar_ends_square_where_its_axis_ends() -> None:
    r = 5e-3
    felt = Proxy(ProxyBody(PLATE, (Bar(*LINE, 0.2e-3, 0.6e-3, 0.3e-3),), r)).follow(
        np.column_stack([np.zeros(800), np.linspace(18e-3, 23e-3, 800), np.full(800, r - 1e-6)])
        + np.array([0.0, 0.0, 0.2e-3]) * (np.arange(800) < 200)[:, None]
    )
    _, y, z = felt.centers.T
    assert np.abs(z - r - step_height(20e-3 - y, 0.2e-3, r)).max() < 1e-9


@pytest.mark.parametrize(
    "section", [lambda *axis: Chain(*axis, 0.3e-3, 0.2e-3), lambda *axis: Bar(*axis, 0.3e-3, 1e-3, 0.2e-3)]
)
def test_an_axis_of_few_points_follows_a_bent_base(section: Callable[..., Part]) -> None:
    u, v = np.meshgrid(np.linspace(-0.6, 0.6, 241), np.linspace(-0.02, 0.02, 5), indexing="ij")
    points = 0.04 * np.column_stack([np.sin(u.ravel()), v.ravel() / 0.04, np.cos(u.ravel())])
    corner = (np.arange(240)[:, None] * 5 + np.arange(4)).ravel()
    quads = np.stack([corner, corner + 5, corner + 6, corner + 1], axis=1)
    bent = Surface(points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    turn = np.linspace(-0.4, 0.4, 6)
    normals = np.column_stack([np.sin(turn), np.zeros(6), np.cos(turn)])
    built = ProxyBody(bent, (section(0.04 * normals, normals),), 5e-3)
    fine = np.linspace(-0.35, 0.35, 2000)
    way = np.column_stack([np.sin(fine), np.zeros(2000), np.cos(fine)])
    felt = Proxy(built).follow((0.04 + 5.3e-3 - 0.02e-3) * way)
    height = np.linalg.norm(felt.centers, axis=1) - 0.04 - 5e-3
    assert np.abs(height - 0.3e-3).max() < 1e-6  # its chords alone would dip by 0.1 mm
