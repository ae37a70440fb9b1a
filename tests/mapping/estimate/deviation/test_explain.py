"""What is wrong with a model is named and corrected, and what is no fault of the model is left to detection."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mapping import FloatArray, Surface, Trace
from mapping.base import Base, LaidTrace
from mapping.estimate.deviation import explain, felt_enough, lay_out
from mapping.estimate.deviation.blocks import Blocks
from mapping.estimate.deviation.drift import SteadyDrift
from mapping.estimate.deviation.explain import FEW_SAMPLES, _robust, _unfelt

TIP = 0.01
NOISE = 20e-6
Warp = Callable[[FloatArray], FloatArray]


def sheet(u: FloatArray, v: FloatArray) -> FloatArray:
    """A saddle of 110 x 90 mm, (..., 3)."""
    return np.stack([u, v, 4.0 * u**2 - 3.0 * v**2], axis=-1)


def plane(u: FloatArray, v: FloatArray) -> FloatArray:
    return np.stack([u, v, 0.0 * u], axis=-1)


def model(body: Callable[[FloatArray, FloatArray], FloatArray] = sheet) -> Base:
    u, v = np.linspace(-0.055, 0.055, 56), np.linspace(-0.045, 0.045, 46)
    vertices = body(*np.meshgrid(u, v, indexing="ij")).reshape(-1, 3)
    i, j = (each.ravel() for each in np.meshgrid(np.arange(55), np.arange(45), indexing="ij"))
    a = 46 * i + j
    faces = np.concatenate([np.column_stack([a, a + 46, a + 47]), np.column_stack([a, a + 47, a + 1])])
    return Base(Surface(vertices, faces))


def felt(
    warp: Warp = lambda points: points,
    *,
    seed: int = 1,
    height: Callable[[FloatArray, FloatArray], FloatArray] = lambda u, v: 0.0 * u,
    each: float = 0.0,
    noise: float = NOISE,
    body: Callable[[FloatArray, FloatArray], FloatArray] = sheet,
) -> Trace:
    """Crossed sweeps over the warped sheet.

    Args:
        warp: of places (N, 3).
        height: of the ball's centre over the sheet at (u, v), m.
        each: standard deviation of the sweeps' own offsets, m.
    """
    rng = np.random.default_rng(seed)
    s, h = np.arange(-0.05, 0.05, 1e-4), 1e-6
    lines = [(s, np.full(len(s), v)) for v in np.linspace(-0.038, 0.038, 7)]
    lines += [(np.full(760, u), s[120:880]) for u in np.linspace(-0.048, 0.048, 8)]
    centers, sweeps = [], []
    for number, (u, v) in enumerate(lines):
        along, across = (
            (warp(body(u + h * a, v + h * b)) - warp(body(u - h * a, v - h * b))) / (2.0 * h) for a, b in np.eye(2)
        )
        normal = np.cross(along, across)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        lift = TIP + height(u, v) + each * rng.standard_normal() + noise * rng.standard_normal(len(u))
        centers.append(warp(body(u, v)) + lift[:, None] * normal)
        sweeps.append(np.full(len(u), number))
    count = sum(map(len, sweeps))
    return Trace(1e-3 * np.arange(count), np.concatenate(centers), np.concatenate(sweeps), TIP)


def turned(points: FloatArray) -> FloatArray:
    """0.3 mm and 0.5 degrees off."""
    rotation = Rotation.from_rotvec(np.radians(0.5) * np.array([0.6, -0.8, 0.0])).as_matrix()
    return points @ rotation.T + 0.3e-3 * np.array([0.48, 0.36, 0.8])


def bent(points: FloatArray) -> FloatArray:
    """0.5 mm up and down over the length of the body."""
    return points + 0.5e-3 * np.sin(60.0 * points[:, :1] + 30.0 * points[:, 1:2] + 0.4) * np.array([0.0, 0.0, 1.0])


def remaining(base: Base, trace: Trace) -> float:
    """Median of the mean heights of 5 mm, m."""
    mean = base.foot(trace.centers, TIP).height[: len(trace) // 50 * 50].reshape(-1, 50).mean(axis=1)
    return float(np.median(np.abs(mean)))


def test_a_body_off_its_model_is_moved() -> None:
    trace, base = felt(turned), model()
    found = explain(trace, base)
    assert found is not None
    assert found.causes == ("pose",)
    assert np.degrees(found.turn) == pytest.approx(0.5, abs=0.02)
    assert remaining(found.base, trace) < 0.02 * remaining(base, trace)
    assert "0.5" in found.sentence()
    assert "moved" in found.sentence()
    assert found.base.pose is not None


def test_a_body_one_per_cent_larger_is_scaled() -> None:
    base = model()
    middle = base.surface.face_areas @ base.surface.vertices[base.surface.faces].mean(axis=1)
    middle /= base.surface.face_areas.sum()
    trace = felt(lambda points: middle + 1.01 * (points - middle))
    found = explain(trace, base)
    assert found is not None
    assert found.causes == ("scale",)
    assert found.scale == pytest.approx(1.01, abs=1e-3)
    assert remaining(found.base, trace) < 0.1 * remaining(base, trace)


def test_a_ball_larger_than_said_is_an_offset() -> None:
    trace, base = felt(height=lambda u, v: 0.1e-3 + 0.0 * u), model()
    found = explain(trace, base)
    assert found is not None
    assert found.causes == ("offset",)
    assert found.offset == pytest.approx(0.1e-3, abs=3e-6)
    assert found.base.offset == found.offset
    assert np.array_equal(found.base.surface.vertices, base.surface.vertices)


def test_a_bent_body_bends_its_model() -> None:
    trace, base = felt(bent), model()
    found = explain(trace, base)
    assert found is not None
    assert found.causes[0] == "deformation"
    assert remaining(found.base, trace) < 0.05 * remaining(base, trace)
    there = (np.abs(base.surface.vertices[:, :2]) < [0.045, 0.035]).all(axis=1)
    true = bent(base.surface.vertices) - base.surface.vertices
    assert np.abs(found.heights - true[:, 2])[there].max() < 0.06e-3


def dent(u: FloatArray, v: FloatArray) -> FloatArray:
    share = np.clip(np.hypot(u - 0.02, v + 0.01) / 0.02, 0.0, 1.0)
    return -1e-3 * (1.0 + np.cos(np.pi * share))


def test_a_dent_is_a_part_that_is_left_out() -> None:
    trace, base = felt(height=dent), model()
    found = explain(trace, base)
    assert found is not None
    assert found.causes == ("part",)
    (part,) = found.parts
    assert part.height == pytest.approx(-2e-3, abs=0.3e-3)
    assert np.linalg.norm(part.points.mean(axis=0)[:2] - [0.02, -0.01]) < 5e-3
    feet = base.foot(trace.centers, TIP).points
    assert not found.outside(feet)[dent(trace.centers[:, 0], trace.centers[:, 1]) < -0.5e-3].any()
    assert found.outside(feet).mean() > 0.75


def test_where_the_finger_was_sent_and_felt_nothing_a_part_is_missing() -> None:
    trace, base = felt(), model()
    gone = (np.abs(trace.centers[:, 0]) < 0.02) & (np.abs(trace.centers[:, 1]) < 0.02)
    trace = trace.select(~gone)
    path = np.column_stack([np.linspace(-0.02, 0.02, 9), np.zeros(9), np.full(9, TIP)])
    assert explain(trace, base) is None
    found = explain(trace, base, [path])
    assert found is not None
    assert found.causes == ("part",)
    assert "nothing was felt there" in found.sentence()


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(k, marks=pytest.mark.slow) for k in range(2, 8))])
def test_a_right_model_is_left_alone(seed: int) -> None:
    assert explain(felt(seed=seed), model()) is None


def wire(u: FloatArray, v: FloatArray) -> FloatArray:
    """The trace of a wire of 0.65 mm across the sheet."""
    beside = u * np.sin(0.3) + v * np.cos(0.3)
    return np.maximum(0.65e-3 - beside**2 / (2.0 * (TIP + 0.325e-3)), 0.0)


def ring(u: FloatArray, v: FloatArray) -> FloatArray:
    """The trace of a ring of wire, wider than the ball."""
    return np.maximum(0.65e-3 - (np.hypot(u, v) - 0.02) ** 2 / (2.0 * (TIP + 0.325e-3)), 0.0)


def step(u: FloatArray, v: FloatArray) -> FloatArray:
    """The trace of an edge 0.5 mm high across the sheet."""
    before = np.maximum(0.01 - u, 0.0)
    return np.clip(0.5e-3 - before**2 / (2.0 * TIP), 0.0, None)


@pytest.mark.parametrize("feature", [wire, ring, step])
def test_a_fine_feature_is_no_fault_of_the_model(feature: Callable[[FloatArray, FloatArray], FloatArray]) -> None:
    assert explain(felt(height=feature), model()) is None


def explored(seed: int) -> Trace:
    """Two wires of 60 mm side by side on a plate: a few sweeps all over it, one of them along each wire at a slant, and
    ten times as many across the wires and off their ends, as of a finger that explores; in noise that hides how steep
    the flanks are."""
    from mapping.geometry.templates import cap_height

    rng, wires = np.random.default_rng(seed), (-0.004, 0.004)
    whole, half, short = (np.arange(-length, length, 5e-5) for length in (0.05, 0.0075, 0.0026))
    lines = [(whole, np.full(len(whole), v)) for v in (-0.03, -0.012, 0.012, 0.03)]
    lines += [(np.full(1400, u), 0.7 * whole[:1400]) for u in (-0.04, -0.015, 0.01, 0.04)]
    lines += [(whole, 0.1 * whole + beside) for beside in wires]
    for beside in wires:
        lines += [(np.full(len(half), u), beside + half) for u in rng.uniform(-0.03, 0.03, 12)]
        lines += [(end + short, np.full(len(short), beside)) for end in (-0.03, 0.03) for _ in range(35)]
    centers, sweeps = [], []
    for number, (u, v) in enumerate(lines):
        beyond = np.maximum(np.abs(u) - 0.03, 0.0)
        one, other = (cap_height(np.hypot(beyond, v - beside), 0.65e-3, 0.325e-3, TIP) for beside in wires)
        z = TIP + np.maximum(one, other) + 0.2e-3 * rng.standard_normal(len(u))
        centers.append(np.column_stack([u, v, z]))
        sweeps.append(np.full(len(u), number))
    return Trace(2e-4 * np.arange(sum(map(len, sweeps))), np.concatenate(centers), np.concatenate(sweeps), TIP)


@pytest.mark.parametrize("seed", range(4))
def test_where_a_finger_went_most_often_is_no_fault_of_the_model(seed: int) -> None:
    assert explain(explored(seed), model(plane)) is None


@pytest.mark.parametrize("feature", [wire, ring, step])
def test_a_fine_feature_does_not_pull_the_pose(feature: Callable[[FloatArray, FloatArray], FloatArray]) -> None:
    found = explain(felt(turned, height=feature), model())
    assert found is not None
    assert found.causes[0] == "pose"
    assert np.degrees(found.turn) == pytest.approx(0.5, abs=0.05)
    assert not found.beyond_repair


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2, 3))])
def test_levels_of_single_sweeps_are_their_drift_and_not_the_model(seed: int) -> None:
    trace, base = felt(each=0.05e-3, seed=seed), model()
    found = explain(trace, base)
    assert found is not None and found.causes == ("drift",) and not found.of_the_model
    assert found.base is base and "the sweeps drift" in found.sentence()
    without = LaidTrace.of(found.without_drift(LaidTrace.of(trace, base)), base)
    levels = [float(sweep.feet().height.mean()) for sweep in without.laid_sweeps]
    assert np.std(levels) < 3e-6


@pytest.mark.parametrize("whole", [0.4e-3, -0.4e-3, 0.05e-3])
def test_an_even_drift_is_the_instruments_and_is_taken_off(whole: float) -> None:
    steady, base = felt(), model()
    lift = base.foot(steady.centers, TIP).normals * (whole * steady.t / steady.t[-1])[:, None]
    trace = Trace(steady.t, steady.centers + lift, steady.sweep, TIP)
    found = explain(trace, base)
    assert found is not None and found.causes == ("drift",) and found.base is base
    (drift,) = found.lines
    facets = 4e-6  # by which the model's facets, 2 mm wide, stay below the sheet
    assert isinstance(drift, SteadyDrift) and drift.whole == pytest.approx(whole, abs=facets)
    assert f"drifts {'upwards' if whole > 0 else 'downwards'} by" in found.sentence()
    without = found.without_drift(LaidTrace.of(trace, base))
    assert np.abs(without.centers - steady.centers).max() < facets


def test_a_drift_of_a_body_that_was_moved_is_told_beside_the_pose() -> None:
    base, errors = model(), []
    for seed in range(1, 5):
        moved = felt(turned, seed=seed)
        lift = base.foot(moved.centers, TIP).normals * (0.3e-3 * moved.t / moved.t[-1])[:, None]
        found = explain(Trace(moved.t, moved.centers + lift, moved.sweep, TIP), base)
        assert found is not None and set(found.causes) == {"pose", "drift"}
        assert sum(each.whole for each in found.lines) == pytest.approx(0.3e-3, rel=0.03)
        errors.append(np.degrees(found.turn) - 0.5)
    # an even drift is nearly a tilt about the line between both halves of the recording: one seed scatters so much
    assert np.sqrt(np.mean(np.square(errors))) < 0.02


def test_slopes_of_single_sweeps_are_taken_off() -> None:
    straight = felt(body=plane)
    numbers, begins = np.unique(straight.sweep, return_index=True)
    place = np.linalg.norm(straight.centers - straight.centers[begins[straight.sweep]], axis=1)
    rise = np.random.default_rng(4).normal(0.0, 1e-3, len(numbers))
    sloping = straight.centers + np.outer(rise[straight.sweep] * (place - 0.04), [0.0, 0.0, 1.0])
    trace, base = Trace(straight.t, sloping, straight.sweep, TIP), model(plane)
    found = explain(trace, base)
    assert found is not None and found.causes == ("drift",)
    without = found.without_drift(LaidTrace.of(trace, base))
    assert np.std(without.centers[:, 2]) < 1.1 * NOISE < 0.7 * np.std(trace.centers[:, 2])


@pytest.mark.parametrize("rise", [0.1e-3, 0.3e-3, 2e-3])
def test_a_step_is_left_to_detection_however_it_lies(rise: float) -> None:
    def ball(u: FloatArray) -> FloatArray:
        return np.where(u > 0, rise, np.maximum(rise - TIP + np.sqrt(np.maximum(TIP**2 - u**2, 0.0)), 0.0))

    for across in (
        lambda u, v: ball(u - 0.013),
        lambda u, v: ball(v - 0.003),
        lambda u, v: ball(0.5 * u + v - 0.004),
        lambda u, v: np.minimum(ball(u + 0.02), ball(0.02 - u)),
    ):
        assert explain(felt(height=across, body=plane), model(plane)) is None


def test_a_fitted_base_is_not_doubted() -> None:
    base = Base(model().surface, "quadric")
    assert explain(felt(turned), base) is None


def test_a_model_of_another_body_is_beyond_repair() -> None:
    """A plane was given, and a dome was felt."""
    dome = felt(lambda p: p + np.column_stack([0 * p[:, :2], 12.0 * (p[:, :1] ** 2 - p[:, 1:2] ** 2)]), body=plane)
    found = explain(dome, model(plane))
    assert found is not None
    assert found.beyond_repair
    assert "mesh" in found.needs()


def test_a_place_beside_any_one_sample_was_felt() -> None:
    places = np.column_stack([np.arange(9) * 10 * TIP, np.zeros((9, 2))])
    ahead = np.array([[0.0, 0.0, 0.0], [0.4 * TIP, 0.0, 0.0]])
    paths = [place + ahead for place in places]
    centers = np.repeat(places[:2], FEW_SAMPLES, axis=0)
    centers[1], centers[FEW_SAMPLES + 5] = places[4], places[6]  # of these neither is among the few
    trace = Trace(np.arange(len(centers)) / 1e3, centers, np.zeros(len(centers), dtype=np.int64), TIP)
    np.testing.assert_array_equal(_unfelt(paths, trace), places[[2, 3, 5, 7, 8]])


def test_the_same_in_other_units() -> None:
    """A body, its tip and its error scaled together give the same answer, scaled."""
    trace, base, factor = felt(turned), model(), 2.0**-20
    other = Trace(trace.t, factor * trace.centers, trace.sweep, factor * TIP)
    found, here = (
        explain(other, Base(Surface(factor * base.surface.vertices, base.surface.faces))),
        explain(trace, base),
    )
    assert found is not None
    assert here is not None
    assert found.causes == here.causes
    assert found.turn == pytest.approx(here.turn, rel=1e-6)
    assert found.shift == pytest.approx(factor * here.shift, rel=1e-6)


def test_a_coarse_mesh_is_divided_before_it_is_bent() -> None:
    corners = np.array([[-0.055, -0.045, 0.0], [0.055, -0.045, 0.0], [0.055, 0.045, 0.0], [-0.055, 0.045, 0.0]])
    base = Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))
    trace = felt(bent, body=plane)
    found = explain(LaidTrace(trace, base), base)
    assert found is not None
    assert found.causes[0] == "deformation"
    assert len(found.base.surface.faces) > 100
    assert remaining(found.base, trace) < 0.1 * remaining(base, trace)


def test_the_skirt_of_a_tall_feature_on_a_small_plate_is_no_deviation() -> None:
    """The paper's bump, 1 / (1 + 15 u^2) high, on a plate of six tip radii: it stands off the plane everywhere."""
    large = 0.11 / 6.0

    def bump(u: FloatArray, v: FloatArray) -> FloatArray:
        return large / (1.0 + 15.0 * (u**2 + v**2) / large**2)

    trace = felt(height=bump, body=plane)
    lifted = trace.centers + np.array([0.0, 0.0, large - TIP])
    assert explain(Trace(trace.t, lifted, trace.sweep, large), model(plane)) is None


def test_heights_without_noise_do_not_tell_two_like_causes_apart_and_need_not() -> None:
    found = _robust(np.ones((40, 2)), np.zeros(40), np.ones(40), np.ones(40, dtype=bool), 3e-4)
    np.testing.assert_array_equal(found, np.zeros(40))


def test_what_speaks_for_a_model_is_told_from_what_says_nothing() -> None:
    whole = felt()
    assert felt_enough(whole, model())
    # ten tip radii of one sweep are twenty blocks: no cause could be told, and none is
    few = whole.select(np.flatnonzero(whole.sweep == whole.sweep[0])[:400])
    lifted = Trace(few.t, few.centers + np.array([0.0, 0.0, 0.4e-3]), few.sweep, TIP)
    assert explain(lifted, model()) is None
    assert not felt_enough(lifted, model())


def test_sweeps_that_were_laid_out_one_by_one_are_not_laid_out_again(monkeypatch: pytest.MonkeyPatch) -> None:
    trace, base = felt(), model()
    whole = Blocks.of(LaidTrace.of(trace, base))
    parts = [LaidTrace(part, base) for _, part in trace.sweeps()]
    metres = sum(float(part.laid_sweeps[0].arclength[-1]) for part in parts)
    for part in parts:
        lay_out(part, metres)
    monkeypatch.setattr("mapping.base.laid_trace.height_profiles", None)
    again = Blocks.of(LaidTrace.together(parts, base), metres)
    np.testing.assert_array_equal(again.height, whole.height)
    np.testing.assert_array_equal(again.points, whole.points)
