"""What a recording does not need is left out, said with what it saved, and changes nothing when forced back in."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import explore3d
from explore3d.analysis.build_model import METHOD
from explore3d.analysis.result import Analysis
from explore3d.analysis.savings import with_savings, without_needless_dynamics
from explore3d.analysis.stages import OPTIONAL_STAGES, Stages
from explore3d.bench.scenes.plate_sweeps import DIAMETER, TIP_RADIUS, Heights, plate, sweeps, wire
from explore3d.errors import UserError
from explore3d.jobs.analyze import analyze
from explore3d.log.own.record import KIND, base_event
from explore3d.log.own.writer import LogWriter
from explore3d.scene.scene import parse_scene
from hw.move import Move
from hw.simulated.finger import SimulatedFinger
from mapping.estimate.sweeps.labels import TOUCHED
from mapping.feature import LeftOut

SCENE = Path(__file__).parents[3] / "assets" / "scenes" / "wire_on_plate.toml"
EMPTY = SCENE.with_name("empty_plate.toml")
Record = Callable[..., Path]


def flat(feet: np.ndarray) -> np.ndarray:
    return np.zeros(len(feet))


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Record:
    """Logs of positions alone, of sweeps over a plate that the log knows."""

    def write(heights: Heights, white: float, half: float = 12e-3, count: int = 3, scene: str = "") -> Path:
        places = np.linspace(-half / 2, half / 2, count)
        trace = sweeps(heights, white=white, places=places, spacing=half / 500, half=half)
        path = tmp_path_factory.mktemp("log") / "log.mcap"
        with LogWriter(path, tip_radius=TIP_RADIUS, scene_text=scene) as log:
            log.event(KIND, base_event(plate()))
            for _, part in trace.sweeps():
                log.write(Move(path=part.centers[[0, -1]], approach=np.array([0.0, 0.0, -1.0])), part)
        return path

    return write


@pytest.fixture(scope="module")
def wired(record: Record) -> tuple[Path, Analysis]:
    path = record(wire(), 0.1e-3)
    return path, analyze(path)


def left(analysis: Analysis) -> dict[str, LeftOut]:
    return {each.stage: each for each in analysis.left_out}


@pytest.mark.slow
def test_a_regular_posterior_needs_no_long_chain_and_one_changes_it_by_less_than_a_third_of_its_width(wired):
    path, short = wired
    assert "k-hat" in left(short)["long chain"].reason
    assert "estimated" in left(short)["long chain"].saved
    forced = analyze(path, force=["long chain"])
    assert "long chain" not in left(forced)
    (one,), (other,) = short.model.features, forced.model.features
    assert (one.posterior.status, other.posterior.status) == ("not needed", "converged")
    for name in ("height", "length"):
        a, b = getattr(one, name), getattr(other, name)
        assert abs(a.median - b.median) < (b.high - b.low) / 3


@pytest.mark.slow
def test_a_given_base_needs_no_fit_and_one_finds_the_same_feature(record):
    path = record(wire(), 0.02e-3, half=60e-3)  # a fit tells base from detail over eight tip radii
    given, fitted = analyze(path), analyze(path, force=["base fit"])
    assert "base fit" in left(given)
    assert "base fit" in fitted.timings
    (one,), (other,) = given.model.features, fitted.model.features
    assert abs(one.height.median - other.height.median) < 0.03e-3


def test_a_trace_without_noise_needs_no_smoothing_and_one_moves_no_point(record):
    path = record(wire(), 0.0)
    raw, smoothed = analyze(path), analyze(path, force=["smoothing"])
    assert "smoothing" in left(raw)
    assert "smoothing" not in left(smoothed)
    for estimate in (raw.estimate, smoothed.estimate):
        points = estimate.points[estimate.labels == TOUCHED]
        to_wire = np.abs(np.hypot(points[:, 1], points[:, 2] - DIAMETER / 2) - DIAMETER / 2)
        assert np.minimum(to_wire, np.abs(points[:, 2])).max() < 1e-4 * TIP_RADIUS
    assert raw.model.features[0].height == smoothed.model.features[0].height


def test_a_given_pose_needs_no_search_and_one_finds_the_object_where_it_is(record):
    path = record(wire(), 0.02e-3, scene=EMPTY.read_text())
    given, sought = analyze(path), analyze(path, force=["pose"])
    assert "pose" in left(given)
    assert "pose" in sought.timings
    assert np.abs(sought.base.surface.vertices - given.base.surface.vertices)[:, 2].max() < 0.05e-3
    (one,), (other,) = given.model.features, sought.model.features
    assert abs(one.height.median - other.height.median) < 0.01e-3


@pytest.mark.slow
def test_a_bare_object_needs_no_rendering_and_a_picture_of_it_changes_no_number(record, tmp_path):
    path = record(flat, 0.1e-3)
    bare, drawn = analyze(path, tmp_path / "bare"), analyze(path, tmp_path / "drawn", force=["rendered pictures"])
    assert not (tmp_path / "bare" / "pictures" / "object.svg").exists()
    assert (tmp_path / "drawn" / "pictures" / "object.svg").exists()
    assert bare.model.features == drawn.model.features
    assert bare.detections.threshold == drawn.detections.threshold


NOTHING = ("grammar", "posterior", "estimated surface", "curvature", "error against time")


def test_where_nothing_is_detected_nothing_follows_and_forcing_it_finds_nothing(record):
    path = record(flat, 0.1e-3)
    bare, forced = analyze(path), analyze(path, force=NOTHING)
    assert set(NOTHING) <= set(left(bare))
    assert set(bare.timings) == {"reading", "deviation", "detection"}
    assert bare.model.features == forced.model.features == ()
    assert not set(left(forced)) & {"grammar", "posterior", "estimated surface"}
    assert forced.detections.threshold == bare.detections.threshold


@pytest.mark.slow
def test_without_a_crossing_a_wire_that_only_many_sweeps_show_is_found_all_the_same(record):
    faint = analyze(record(wire(), 2.9e-3, count=12))
    assert faint.detections.crossings == ()
    assert faint.detections.detection_limit > DIAMETER
    (ridge,) = faint.model.features
    assert np.abs(ridge.axis[:, 1]).max() < 1e-3
    assert "grammar" not in left(faint)


def test_where_each_sweep_shows_all_that_is_asked_for_no_fainter_lines_are_sought_and_none_would_be_found(record):
    path = record(flat, 0.1e-3, count=12, scene=EMPTY.read_text())
    bare, forced = analyze(path), analyze(path, force=["grammar", "faint lines"])
    assert "asks for" in left(bare)["grammar"].reason
    assert bare.detections.detection_limit < bare.scene.survey.smallest_feature
    assert "grammar" in forced.timings
    assert bare.model.features == forced.model.features == ()


@pytest.mark.slow
def test_beside_what_single_sweeps_show_fainter_lines_are_sought_only_if_the_scene_asks_for_them(record):
    path = record(wire(), 0.1e-3, count=6, scene=EMPTY.read_text())
    plain, forced = analyze(path), analyze(path, force=["faint lines"])
    assert "asks for" in left(plain)["faint lines"].reason
    assert "faint lines" not in left(forced)
    assert [f.height for f in plain.model.features] == [f.height for f in forced.model.features] != []
    lower = EMPTY.read_text().replace('smallest_feature = "0.3 mm"', 'smallest_feature = "0.05 mm"')
    assert "faint lines" not in left(analyze(record(wire(), 0.1e-3, count=6, scene=lower)))


def test_a_stage_that_there_is_not_cannot_be_forced_and_the_possible_ones_are_named(wired):
    with pytest.raises(UserError, match=r"no stage 'smoothness' to force; possible: .*smoothing"):
        analyze(wired[0], force=["smoothness"])


def test_every_stage_that_is_asked_whether_it_is_needed_can_be_forced():
    sources = [path.read_text() for path in Path(explore3d.__file__ or "").parent.rglob("*.py")]
    asked = {name for text in sources for name in re.findall(r"stages\.(?:needed|is_forced)\(\s*\"([^\"]+)\"", text)}
    # detections that a large log brings along are taken as they are: nobody asks for them
    asked |= {stage.name for stage in METHOD if stage.name} - {"detection"}
    assert asked == set(OPTIONAL_STAGES)


@pytest.mark.slow
def test_without_contact_data_the_algorithms_that_need_it_stay_left_out_even_if_forced(wired):
    path, plain = wired
    forced = analyze(path, force=["algorithms 1 and 2"])
    assert "algorithms 1 and 2" in left(plain)
    assert "algorithms 1 and 2" in left(forced)
    assert forced.model.features[0].height == plain.model.features[0].height


def scene_of(stiffness: float):
    text = SCENE.read_text() + f"\n[finger.dynamics]\nmass = 0.001\nstiffness = {stiffness}\n"
    return parse_scene(text, SCENE)


def test_a_tip_that_follows_within_the_noise_needs_no_dynamics():
    stages, forced = Stages(), Stages(forced=["dynamics"])
    assert without_needless_dynamics(scene_of(1e6), stages).finger.dynamics is None
    assert [each.stage for each in stages.left_out] == ["dynamics"]
    assert without_needless_dynamics(scene_of(1e6), forced).finger.dynamics is not None
    assert without_needless_dynamics(scene_of(10.0), Stages()).finger.dynamics is not None


def test_dynamics_forced_back_in_move_the_trace_by_less_than_the_noise():
    from hw.simulated.dynamic_finger import DynamicFinger
    from hw.simulated.dynamics import Dynamics

    scene = scene_of(1e6)
    common = {"object": scene.object_surface(), "tip_radius": scene.tip.radius, "rate": scene.finger.rate}
    normal = np.array([0.0, -1.0, 1.0]) / np.sqrt(2.0)
    middle = np.array([0.012, -0.005, -0.005])
    across = np.array([0.0, 1.0, 1.0]) / np.sqrt(2.0)
    path = np.array([middle - 0.012 * across, middle + 0.012 * across]) + 0.02 * normal
    traces = []
    for finger in (SimulatedFinger(**common), DynamicFinger(**common, dynamics=Dynamics(mass=1e-3, stiffness=1e6))):
        traces.append(finger.execute(Move(path=path, approach=-normal, speed=scene.survey.speed)))
    rigid, soft = (trace.centers @ normal for trace in traces)
    assert np.ptp(rigid) > 0.5e-3  # the wire was crossed
    assert np.sqrt(np.mean((rigid - soft) ** 2)) < scene.finger.noise.white / 10


def test_savings_are_labelled_as_estimates_and_only_given_where_there_is_one():
    stages = [LeftOut("estimated surface", "why"), LeftOut("pose", "why"), LeftOut("grammar", "why", "3 s (measured)")]
    saved = [each.saved for each in with_savings(stages, {"detection": 2.0})]
    assert saved == ["about 4.2 s (estimated: 2.1 times the detection)", "", "3 s (measured)"]


# What is done in one process, what it must load, and what it must not
LOADED = {
    "nothing found": (
        "from explore3d.analyze import analyze; analyze({bare!r})",
        "mapping.detection.detect",
        {"emcee", "matplotlib", "plotly", "open3d", "trimesh", "igl", "serial"},
    ),
    "a flat base planned over": (
        "from explore3d.bench.scenes import plate; from planners.explore import Explore;"
        "next(Explore(base=plate(0.03), tip_radius=0.01, smallest=3e-4).plan())",
        "planners.survey.level_field",
        {"igl"},
    ),
    "a wire": (
        "analyze({wired!r})",
        "mapping.estimate.envelope.envelope",
        {"emcee", "matplotlib", "plotly", "open3d", "serial"},
    ),
}


@pytest.fixture(scope="module")
def loaded(record: Record, wired: tuple[Path, Analysis]) -> dict[str, list[str]]:
    """All modules that one process has loaded after each."""
    bare = record(flat, 0.1e-3)
    code = "; ".join(f"{what}; print(*sys.modules)" for what, _, _ in LOADED.values())
    code = f"import sys; {code.format(bare=str(bare), wired=str(wired[0]))}"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    return dict(zip(LOADED, (line.split() for line in told.splitlines()), strict=True))


@pytest.mark.parametrize("case", LOADED)
def test_positions_alone_load_nothing_that_only_contact_data_chains_geodesics_or_viewers_need(loaded, case):
    _, needed, needless = LOADED[case]
    assert needed in loaded[case]
    assert not needless & set(loaded[case])


def test_a_flat_base_needs_no_geodesics_and_they_would_space_the_sweeps_alike():
    from explore3d.bench.trace import bump_mesh
    from mapping.surface import Surface
    from planners.survey.level_field import _geodesic, _slope, level_field

    mesh = bump_mesh(800)
    flat_mesh = Surface(mesh.vertices * np.array([1.0, 1.0, 0.0]), mesh.faces)
    chart = np.arange(len(flat_mesh.faces))
    field = level_field(flat_mesh, flat_mesh.vertices, chart)
    assert field.kind == "linear"
    distance = _geodesic(flat_mesh.vertices, flat_mesh.faces)
    assert distance is not None
    corner = flat_mesh.vertices[distance.argmin()]
    straight = np.linalg.norm(flat_mesh.vertices - corner, axis=1)
    # its level sets lie as far apart as those of a coordinate
    assert np.abs(distance - straight).max() < 0.05 * straight.max()
    assert _slope(flat_mesh.vertices, flat_mesh.faces, flat_mesh.vertices[:, 0]) == pytest.approx(1.0)
