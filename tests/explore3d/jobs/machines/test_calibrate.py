"""Calibration and self-test on a sphere, by the simulated finger and by an emulated machine."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from calibration_sphere import RADIUS, sphere_scene

from explore3d.jobs.machines.calibrate import calibrate, selftest, write_profile
from explore3d.scene.scene import parse_scene
from explore3d.scene.settings import AnalysisSettings

SIMULATED = 'kind = "simulated"\n[finger.noise]\nwhite = "0.05 mm"\ncorrelated = "0.005 mm"'
MACHINE = """kind = "grbl"
[finger.machine]
port = "emulator"
origin = ["-150 mm", "-150 mm", "-70 mm"]
step = "4 mm"
clearance = "2 mm"
probe_speed = "20 mm/s"
pace = 20
"""


def test_the_simulated_tip_is_found_within_its_interval_and_written_as_a_profile(tmp_path: Path) -> None:
    profile = calibrate(sphere_scene(tmp_path, SIMULATED), RADIUS, (0.0, 0.0, 0.0), lines=6)
    # the flat faces of the sphere's mesh lie up to 2 um inside it
    assert profile.tip.radius == pytest.approx(0.01, abs=3.0 * profile.tip.radius_sd + 2e-6)
    assert profile.tip.noise.white == pytest.approx(5e-5, rel=0.05)
    radius, center, noise, deviation = profile.lines()
    assert radius.startswith("tip radius 9.99") and radius.endswith("), a 90 % interval")
    assert " 0.0" not in noise and "-0.0," not in center and "µm" in deviation  # each in a unit that shows its digits
    write_profile(profile, tmp_path / "tip.toml")
    kept = tomllib.loads((tmp_path / "tip.toml").read_text())
    assert kept["radius"] == profile.tip.radius and kept["schema"] == "explore3d/tip/1"
    text = (tmp_path / "scene.toml").read_text().replace('radius = "10 mm"', 'profile = "tip.toml"')
    named = parse_scene(text, tmp_path / "other.toml")
    assert named.tip.radius == profile.tip.radius
    resolved = parse_scene(named.resolved, tmp_path / "resolved.toml", files_from=[tmp_path])
    assert resolved.tip.radius == profile.tip.radius
    assert AnalysisSettings.of(named).tip_sd == AnalysisSettings.of(resolved).tip_sd == profile.tip.radius_sd > 0.0
    sure = text.replace('profile = "tip.toml"', 'profile = "tip.toml"\nradius_sd = 0')
    assert AnalysisSettings.of(parse_scene(sure, tmp_path / "sure.toml")).tip_sd == 0.0


@pytest.mark.slow
def test_an_emulated_machine_finds_its_tip_within_ten_micrometres(tmp_path: Path) -> None:
    profile = calibrate(sphere_scene(tmp_path, MACHINE), RADIUS, (0.0, 0.0, 0.0), lines=3)
    assert abs(profile.tip.radius - 0.01) < 1e-5


def test_the_self_test_pairs_the_range_of_radii_with_the_time(tmp_path: Path) -> None:
    found = selftest(sphere_scene(tmp_path, SIMULATED), RADIUS, (0.0, 0.0, 0.0))
    assert 4 * found["sd"] < found["range"] < 12 * found["sd"]
    assert found["time"] > 0 and found["samples"] > 1000
