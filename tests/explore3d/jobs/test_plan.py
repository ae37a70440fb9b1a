"""Plans: what a key of the scene costs or saves in finger time, before anything moves."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scene_files import write_scene_file

from explore3d.analysis.surface_account import SurfaceAccount
from explore3d.errors import SceneError
from explore3d.jobs.expedition import explorer
from explore3d.jobs.plan import DryRun, plan_scene
from explore3d.jobs.run import run, scene_finger
from explore3d.scene.scene import parse_scene
from hw.simulated import SimulatedFinger
from mapping import Surface
from mapping.base import Base
from mapping.detection import narrowest_groove
from planners.paths import pressed_sweep

WIRE = Path(__file__).resolve().parents[3] / "assets" / "scenes" / "wire_on_plate.toml"
TEXT = WIRE.read_text()
RIDGE = TEXT.replace("[survey]", '[survey]\nshortest_ridge = "40 mm"')
FASTEST = RIDGE.replace('speed = "30 mm/s"', 'speed = "fastest"')


def planned(folder: Path, text: str) -> DryRun:
    return plan_scene(write_scene_file(folder / "scene.toml", text))


def sweeping(plan: DryRun) -> float:
    """Time of the sweeps, s."""
    return sum(move.duration for move in plan.moves if move.purpose == "sweep")


@pytest.mark.slow
def test_the_span_of_the_shortest_ridge_and_the_fastest_speed_save_finger_time(tmp_path: Path) -> None:
    ridges, fast = planned(tmp_path, RIDGE), planned(tmp_path, FASTEST)
    assert sweeping(ridges) < 80.0  # 253 s where bumps are looked for, too
    assert not ridges.violations and not fast.violations
    assert fast.speed == pytest.approx(0.25) and fast.record()["speed"] == fast.speed
    assert sweeping(fast) == pytest.approx(sweeping(ridges) * 0.03 / 0.25, rel=1e-6)


@pytest.mark.slow
def test_what_a_detail_adds_is_foretold(tmp_path: Path) -> None:
    text = TEXT.replace("wire_on_plate.ply", "wire_on_tile.ply").replace("meshes/plate.ply", "meshes/tile.ply")
    text = text.replace('radius = "10 mm"', 'radius = "5 mm"').replace('white = "0.2 mm"', 'white = "0.05 mm"')
    text = text.replace('speed = "30 mm/s"', "")
    plan = planned(tmp_path, text)
    assert plan.detail is not None and plan.detail.bump is not None
    assert 0.5 < plan.detail.bump < plan.detail.ridge
    assert plan.detail.sentence() in plan.lines()
    # nothing was moved, and what was read can be held against the drawing
    account = next(line for line in plan.lines() if line.startswith("Of the surface"))
    assert "% would be swept" in account and "% would not be inspected" in account
    assert plan.lines()[0] == f"the mesh: {plan.mesh}" and plan.mesh.startswith("60 mm x 40 mm x 0 mm")
    scene = parse_scene(text, WIRE)
    with scene_finger(scene) as finger:
        expedition = explorer(scene, finger.workspace)
        expedition.go(finger.execute)
        assert isinstance(finger, SimulatedFinger)
        # one ridge of 27 mm
        assert finger.clock == pytest.approx(plan.seconds + plan.detail.ridge, rel=0.1)


def block_scene(folder: Path, low: float, high: float) -> Path:
    """A block of 60 x 40 x 6 mm, two triangles a side, and a region of 14 x 8 mm from low to high (mm)."""
    trimesh.creation.box(extents=[60.0, 40.0, 6.0]).export(folder / "block.stl")
    region = f'{{ low = ["3 mm", "-4 mm", "{low} mm"], high = ["17 mm", "4 mm", "{high} mm"] }}'
    text = f"""
schema = "explore3d/scene/1"
[tip]
radius = "1 mm"
[model]
mesh = "block.stl"
units = "mm"
region = {region}
[finger]
kind = "simulated"
object = "block.stl"
units = "mm"
[survey]
smallest_feature = "0.1 mm"
speed = "20 mm/s"
"""
    path = folder / "scene.toml"
    path.write_text(text)
    return path


def test_a_region_inside_the_triangles_of_a_side_is_planned_and_accounted_for(tmp_path: Path) -> None:
    plan = plan_scene(block_scene(tmp_path, 2.0, 4.0))
    assert plan.account is not None and plan.account.area == pytest.approx(14e-3 * 8e-3)
    assert plan.account.swept == plan.record()["covered"] == 1.0 and not plan.account.short
    ways = np.concatenate([move.path for move in plan.moves if move.purpose == "sweep"])
    assert (ways[:, :2] >= np.array([3e-3, -4e-3]) - 1e-9).all() and (
        ways[:, :2] <= np.array([17e-3, 4e-3]) + 1e-9
    ).all()


def test_a_region_without_surface_is_refused_before_anything_moves(tmp_path: Path) -> None:
    scene = block_scene(tmp_path, 10.5, 18.0)
    told = (
        "model.region: the mesh has no surface in it; found x from 3 to 17 mm, y from -4 to 4 mm, z from 10.5 to 18 "
        "mm, possible is what meets the mesh, x from -30 to 30 mm, y from -20 to 20 mm, z from -3 to 3 mm"
    )
    with pytest.raises(SceneError, match=re.escape(told)):
        plan_scene(scene)
    with pytest.raises(SceneError, match=re.escape(told)):
        run(scene, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("pose", ["given", "estimate"])
def test_a_region_too_small_for_a_sweep_is_refused_before_anything_moves(pose: str, tmp_path: Path) -> None:
    scene = block_scene(tmp_path, 2.0, 4.0)
    small = (
        scene.read_text().replace("14 mm", "3 mm").replace('high = ["17 mm", "4 mm",', 'high = ["3.01 mm", "-3.99 mm",')
    )
    scene.write_text(small.replace('units = "mm"\nregion', f'units = "mm"\npose = "{pose}"\nregion'))
    with pytest.raises(SceneError, match=r"model.region: no sweep fits into it.*0\.72 mm between sweeps"):
        run(scene, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_what_sweeps_touched_that_show_nothing_was_not_swept(tmp_path: Path) -> None:
    scene = block_scene(tmp_path, 2.0, 4.0)
    text = scene.read_text().replace('high = ["17 mm", "4 mm",', 'high = ["4 mm", "-3 mm",')  # a millimetre square
    few = run_text(tmp_path, text.replace("[survey]", 'rate = "80 Hz"\n[survey]'), "few")
    assert few.swept == 0.0
    assert few.short
    assert "2 mm of sweeps are too short, or have too few samples, to show anything" in few.warning()
    many = run_text(tmp_path, text, "many")
    assert many.swept == 1.0
    assert not many.short


def run_text(folder: Path, text: str, name: str) -> SurfaceAccount:
    scene = folder / f"{name}.toml"
    scene.write_text(text)
    account = run(scene, folder / name, report=False).account
    assert account is not None
    return account


@pytest.mark.slow
def test_pecks_far_apart_leave_surface_between_them(tmp_path: Path) -> None:
    """A probe touches where it pecks alone: a plan that counts the whole way between promises what no run keeps."""
    text = WIRE.with_name("grbl_peck.toml").read_text()
    swept = []
    for step in ("0.5 mm", "4 mm"):
        plan = planned(tmp_path, text.replace('step = "0.5 mm"', f'step = "{step}"'))
        assert plan.account is not None
        swept.append(plan.account.swept)
        # one time is told, that of the pecks, not that of sliding at the speed of the sweeps
        (told,) = (line for line in plan.lines() if "of finger path" in line)
        assert re.search(r"finger path, pecking takes it about .*, ways included$", told) and "mm/s" not in told
    assert swept[0] > 0.99 and swept[1] < 0.96


@pytest.mark.slow
def test_how_far_the_finger_leaves_its_region_is_told(tmp_path: Path) -> None:
    scene = block_scene(tmp_path, 2.0, 4.0)
    told = plan_scene(scene).account
    assert told is not None
    assert told.touched_beyond == 0.0
    assert "Sweeps stay in the region; what is found is followed to its ends, out of it, too." in told.sentence()
    scene.write_text(scene.read_text().replace('units = "mm"\nregion', 'units = "mm"\npose = "estimate"\nregion'))
    away = plan_scene(scene).account
    assert away is not None
    assert away.touched_beyond is not None
    assert 30e-3 < away.touched_beyond < 60e-3  # to the block's far end, and to its underside
    assert "Sweeps leave the region by up to" in away.sentence()


@pytest.mark.slow
def test_the_underside_is_told_and_left_out_where_the_scene_names_sides(tmp_path: Path) -> None:
    text = block_scene(tmp_path, 2.0, 4.0).read_text()
    whole, above = tmp_path / "whole.toml", tmp_path / "above.toml"
    without = "\n".join(line for line in text.splitlines() if not line.startswith("region")).replace(
        '"0.1 mm"', '"0.4 mm"'
    )
    whole.write_text(without)
    above.write_text(without.replace("[model]", '[model]\nsides = ["+z"]'))
    area = 2 * (60 * 40 + 60 * 6 + 40 * 6) * 1e-6
    both = [plan_scene(path).account for path in (whole, above)]
    assert both[0] is not None and both[1] is not None
    assert both[0].area == pytest.approx(area)
    assert both[0].below == pytest.approx(60 * 40e-6 / area, abs=0.01)
    assert "It includes the underside, 40 % of it" in both[0].sentence()
    assert both[1].area == pytest.approx(60 * 40e-6)
    assert "underside" not in both[1].sentence()


def test_sides_that_no_face_looks_to_are_refused(tmp_path: Path) -> None:
    scene = block_scene(tmp_path, 2.0, 4.0)
    scene.write_text(scene.read_text().replace("[model]", '[model]\nsides = ["-x"]'))
    with pytest.raises(SceneError, match="sides: no face of the mesh that is to be explored lies within 60 degrees"):
        plan_scene(scene)


@pytest.mark.parametrize(
    ("changes", "speed"),
    [
        ({}, 0.25),  # 25 tip radii per second
        ({"[survey]": "[finger.dynamics]\n[survey]"}, 0.0808),  # 1000 / s x 0.201 mm / (10 tan 14 degrees)
        ({"[survey]": "[finger.dynamics]\nmass = 0.4\n[survey]"}, 0.0404),  # half the rate
        # 0.2 mm / 1.25 is to stand out 6.5 times: 24.6 um, of which the correlated part takes 15.3, so that white noise
        # may take 19.3 = 200 sqrt(15 Delta / (16 w)) with w = 1.79 mm: Delta = 17.7 um, 88 mm/s; the next tried
        ({'"0.3 mm"': '"0.2 mm"'}, 0.082),
    ],
)
def test_the_fastest_speed_follows_from_noise_dynamics_and_the_smallest_feature(
    changes: dict[str, str], speed: float
) -> None:
    text = FASTEST
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new, 1)
    assert parse_scene(text, WIRE).sweep_speed == pytest.approx(speed, rel=0.08)


def test_a_scene_that_names_no_speed_sweeps_as_fast_as_it_may() -> None:
    unsaid = FASTEST.replace('speed = "fastest"', "")
    assert parse_scene(unsaid, WIRE).sweep_speed == parse_scene(FASTEST, WIRE).sweep_speed
    heavy = unsaid.replace("[survey]", "[finger.dynamics]\n[survey]")
    assert parse_scene(heavy, WIRE).sweep_speed == pytest.approx(0.0808, rel=0.08)
    # of a machine nothing says how fast its tip follows; of a finger without noise nothing asks for more
    pecked = WIRE.with_name("grbl_peck.toml")
    assert parse_scene(pecked.read_text().replace('speed = "20 mm/s"\n', "", 1), pecked).sweep_speed == 0.03
    silent = unsaid.replace('white = "0.2 mm"', "").replace('correlated = "0.02 mm"', "")
    assert parse_scene(silent, WIRE).sweep_speed == 0.03
    assert parse_scene(silent.replace('"10 mm"', '"1 mm"', 1), WIRE).sweep_speed == pytest.approx(0.025)


def test_a_groove_is_asked_for_by_its_width() -> None:
    """The ball sinks b^2 / (8 r) = 34 um into 0.9 mm: as hard to see as a crest of two thirds of that."""
    text = TEXT.replace('radius = "10 mm"', 'radius = "3 mm"').replace('speed = "30 mm/s"', "")
    text = text.replace('rate = "5 kHz"', 'rate = "1 kHz"').replace('white = "0.2 mm"', 'white = "0.01 mm"')
    text = text.replace('correlated = "0.02 mm"', 'correlated = "0.001 mm"')
    crest, groove = 'smallest_feature = "0.3 mm"', 'narrowest_groove = "0.9 mm"'
    assert crest in text
    coarse, fine = (parse_scene(text.replace(crest, each), WIRE) for each in (crest, groove))
    both = parse_scene(text.replace(crest, f"{crest}\n{groove}"), WIRE)
    assert fine.smallest == both.smallest == pytest.approx(0.66 * 0.9e-3**2 / (8 * 3e-3), rel=0.02)
    assert fine.sweep_speed == both.sweep_speed < 0.5 * coarse.sweep_speed
    assert fine.expected_limit is not None and narrowest_groove(fine.expected_limit, 3e-3) < 0.9e-3
    with pytest.raises(SceneError, match=r"survey\.smallest_feature, survey\.narrowest_groove, or both"):
        parse_scene(text.replace(crest, ""), WIRE)


def test_a_fastest_speed_that_cannot_be_known_is_refused() -> None:
    silent = FASTEST.replace('white = "0.2 mm"', "").replace('correlated = "0.02 mm"', "")
    with pytest.raises(SceneError, match=r"survey\.speed: the fastest speed follows from the noise, and finger\.noise"):
        parse_scene(silent, WIRE)
    pecked = WIRE.with_name("grbl_peck.toml")
    with pytest.raises(SceneError, match=r"survey\.speed: the fastest speed that a machine can follow is not known"):
        parse_scene(pecked.read_text().replace('speed = "20 mm/s"', 'speed = "fastest"'), pecked)
    with pytest.raises(SceneError, match=r'survey\.speed: expected a speed .*or write "fastest"'):
        parse_scene(FASTEST.replace('"fastest"', '"fast"'), WIRE)


@pytest.mark.slow
def test_plan_and_run_promise_the_same_and_keep_it(tmp_path: Path) -> None:
    """Sweeps lie so close that the noise lets the height asked for be found halfway between two of them."""
    text = TEXT.replace("wire_on_plate.ply", "tile.ply").replace("meshes/plate.ply", "meshes/tile.ply")
    text = text.partition("[[truth]]")[0].replace('radius = "10 mm"', 'radius = "5 mm"').replace("5 kHz", "2 kHz")
    counts = []
    for smallest in ("0.5 mm", "0.22 mm"):  # a third of the one is hidden, and two thirds of the other
        asked = text.replace('"0.3 mm"', f'"{smallest}"')
        plan, found = planned(tmp_path, asked), run(parse_scene(asked, WIRE), tmp_path / smallest, report=False)
        assert plan.account is not None and found.account is not None and found.inspected is not None
        assert found.inspected.asked is not None
        share = found.inspected.share(found.inspected.asked)
        assert share == pytest.approx(found.account.swept, abs=1e-9) and share > 0.95
        assert plan.account.swept == pytest.approx(share, abs=0.02)
        assert float(found.trace.t[-1]) == pytest.approx(plan.seconds, rel=0.1)
        counts.append(sum(move.purpose == "sweep" for move in plan.moves))
    assert counts[1] > 2 * counts[0]


@pytest.mark.slow
def test_noise_that_hides_what_was_asked_for_is_said_first(tmp_path: Path) -> None:
    text = TEXT.replace("wire_on_plate.ply", "tile.ply").replace("meshes/plate.ply", "meshes/tile.ply")
    text = text.partition("[[truth]]")[0].replace('"0.3 mm"', '"0.1 mm"').replace('radius = "10 mm"', 'radius = "5 mm"')
    plan = planned(tmp_path, text)
    assert plan.account is not None and plan.account.hidden is not None and plan.account.hidden > 1e-4
    assert plan.lines()[0] == plan.account.warning()
    assert "noise" in plan.account.warning()


def test_a_budget_that_ends_the_survey_is_said_first_with_what_it_would_take(tmp_path: Path) -> None:
    plan = planned(tmp_path, TEXT.replace('time_budget = "10 min"', 'time_budget = "20 s"'))
    assert plan.short and plan.account is None and plan.record()["stopped"] == plan.stopped == plan.lines()[0]
    assert "take about 4 min 13 s at 30 mm/s" in plan.stopped and "the time budget is 20 s" in plan.stopped


@pytest.mark.slow
def test_a_feature_that_is_asked_for_far_too_small_is_planned_for_all_the_same(tmp_path: Path) -> None:
    """Of a wire of half a micrometre every vertex of its round end lay within what is taken for one."""
    text = TEXT.replace('smallest_feature = "0.3 mm"', 'smallest_feature = "0.3 um"')
    plan = planned(tmp_path, text.replace('time_budget = "10 min"', 'time_budget = "5 min"'))
    assert plan.detail is None and "take about 2 h" in plan.stopped


@pytest.mark.slow
def test_of_many_moves_that_break_a_limit_some_are_told(tmp_path: Path) -> None:
    plan = planned(tmp_path, TEXT.replace('time_budget = "10 min"', 'time_budget = "20 s"'))
    many = replace(plan, violations=tuple((number, "too far") for number in range(1, 15)))
    assert many.lines()[-1] == "and 4 more such moves; --json lists all"
    assert sum(line.startswith("move ") for line in many.lines()) == 10 and len(many.record()["violations"]) == 14
    few = replace(plan, violations=((1, "too far"),))
    assert few.lines()[-1] == "move 1: too far"


def test_a_sweep_that_another_wall_holds_up_is_accounted_for_where_the_ball_rests() -> None:
    wall, radius, steep = 12e-3, 3e-3, np.radians(40.0)
    upward, outward = np.array([0.0, np.cos(steep), np.sin(steep)]), np.array([0.0, -np.sin(steep), np.cos(steep)])
    corners = [
        [x, side * up * upward[1], up * upward[2]] for side, up in ((-1, wall), (1, 0), (1, wall)) for x in (0, 0.02)
    ]
    valley = Surface(np.array(corners), np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]]))
    text = f"""
schema = "explore3d/scene/1"
tip = {{ radius = {radius} }}
model = {{ mesh = "valley" }}
finger = {{ kind = "simulated", object = "valley", noise = {{ white = 1e-5 }} }}
survey = {{ smallest_feature = 1e-4 }}
"""
    scene, base = parse_scene(text, "valley.toml", {"valley": valley}), Base(valley)
    ends, normals = np.array([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0]]), np.tile(outward, (2, 1))
    # so far up each wall it touches both
    touching = radius * np.tan(steep)
    deep, rests = (pressed_sweep(ends + up * upward, normals, radius, 0.03, 1.0) for up in (touching - 2e-4, touching))
    told, true = (SurfaceAccount.of_plan([move], [], base, scene) for move in (deep, rests))
    assert told is not None and true is not None
    # pressed deeper it rests on the other wall alone
    assert told.swept == pytest.approx(0.5 * true.swept, abs=0.002)
