"""The examples: programs that somebody begins with run as printed, and a package of others is named in a scene."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from explore3d.errors import SceneError
from explore3d.scene.finger import kinds
from explore3d.scene.scene import load_scene, parse_scene

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = sorted((ROOT / "examples").glob("*.py"))
KLIPPER = ROOT / "examples" / "klipper"
POINTS = "[explore3d.fingers]\nklipper = explore3d_klipper:KlipperTable\nbroken = no_such_module:Table\n"
POINTS += "alien = explore3d_klipper:KlipperFinger\nsimulated = explore3d_klipper:KlipperTable\n"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """What an editable installation leaves: a folder of metadata, and the sources' own folder on the path."""
    metadata = tmp_path / "site" / "explore3d_klipper-0.1.0.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: explore3d-klipper\nVersion: 0.1.0\n")
    (metadata / "entry_points.txt").write_text(POINTS)
    for folder in (metadata.parent, KLIPPER):
        monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(map(str, (metadata.parent, KLIPPER, ROOT))))
    kinds.cache_clear()  # packages are looked up once
    yield tmp_path
    kinds.cache_clear()
    sys.modules.pop("explore3d_klipper", None)


def test_a_package_of_others_is_named_in_a_scene_and_its_table_is_checked(installed: Path) -> None:
    scene = load_scene(KLIPPER / "scene.toml")
    assert type(scene.finger).__name__ == "KlipperTable"
    assert parse_scene(scene.resolved, "scene.toml", files_from=[KLIPPER]).resolved == scene.resolved
    assert scene.finger.is_real
    for old, new, message in (
        ("origin =", "orign =", "finger.orign: unknown key; did you mean 'origin'"),
        ('"100 mm", "20 mm"', '"100 mm", "20 N"', "finger.origin"),
        ('"klipper"', '"broken"', "cannot be loaded: ModuleNotFoundError"),
        ('"klipper"', '"alien"', "is no subclass of FingerTable"),
        ('"klipper"', '"simulated"', "finger.url: unknown key"),  # ours are not covered by theirs
    ):
        with pytest.raises(SceneError, match=message) as refusal:
            parse_scene(scene.text.replace(old, new), KLIPPER / "scene.toml")
        assert "\n" not in str(refusal.value)


def test_what_is_not_installed_is_named_with_what_is() -> None:
    with pytest.raises(SceneError, match="unknown kind 'klipper'; possible: given, grbl, simulated"):
        load_scene(KLIPPER / "scene.toml")


@pytest.mark.slow
def test_the_command_line_plans_and_explores_with_it(installed: Path) -> None:
    program = (
        "import shutil, subprocess, sys; from fake_moonraker import FakePrinter; from pathlib import Path\n"
        "with FakePrinter(lambda x, y: 0.025, pace=200.0) as printer:\n"
        f"    text = Path({str(KLIPPER / 'scene.toml')!r}).read_text()\n"
        "    scene = Path(sys.argv[1]); shutil.copy('tile.ply', scene.parent)\n"
        "    scene.write_text(text.replace('http://localhost:7125', printer.url))\n"
        "    for words in (['plan', scene], ['run', scene, '--out', sys.argv[2], '--arm']):\n"
        "        done = subprocess.run([sys.executable, '-m', 'explore3d', *words], capture_output=True, text=True)\n"
        "        print(done.returncode, done.stdout.splitlines()[:1], repr(done.stderr[-300:]))\n"
    )
    words = [sys.executable, "-c", program, str(installed / "scene.toml"), str(installed / "out")]
    told = subprocess.run(words, capture_output=True, text=True, cwd=KLIPPER)
    plan, run = told.stdout.splitlines()[:2]
    assert plan.startswith("0 "), told
    assert run.startswith("0 "), told
    assert (installed / "out" / "report.html").is_file()
    assert 'kind = "klipper"' in (installed / "out" / "scene.toml").read_text()


@pytest.mark.slow
def test_the_example_passes_its_conformance_suite(installed: Path) -> None:
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(KLIPPER)]
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout


def test_every_program_is_short_and_its_picture_is_in_the_documents() -> None:
    page = (ROOT / "docs" / "examples.md").read_text("utf-8")
    assert [each.stem for each in PROGRAMS] == ["cnc_probe", "own_detector", "robot_fingertip", "stylus_metrology"]
    for program in PROGRAMS:
        assert len(program.read_text("utf-8").splitlines()) < 80, program.name
        assert f"(../examples/{program.name})" in page and f"({program.stem}.png)" in page
        assert (ROOT / "docs" / f"{program.stem}.png").read_bytes()[:4] == b"\x89PNG"


@pytest.fixture
def told(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """What a program says that is run in an empty folder, as a user runs it."""
    words = [sys.executable, str(ROOT / "examples" / f"{request.param}.py"), str(tmp_path / "out")]
    surroundings = os.environ | {"PYTHONPATH": str(ROOT), "MPLBACKEND": "agg"}
    done = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path, env=surroundings)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / f"{request.param}.png").stat().st_size > 10_000
    assert list(tmp_path.iterdir()) == [tmp_path / "out"]
    return done.stdout


def numbers(text: str) -> list[float]:
    return [float(each) for each in re.findall(r"-?\d+(?:\.\d+)?", text)]


@pytest.mark.slow
@pytest.mark.parametrize("told", ["robot_fingertip"], indirect=True)
def test_a_robot_finds_the_wire_that_nobody_told_of(told: str) -> None:
    (line,) = [each for each in told.splitlines() if each.startswith("ridge-1: ")]
    _, height, low, high, length, shortest, longest = numbers(line.replace("ridge-1", "ridge 1"))
    assert low < 0.65 < high and high - low < 0.01 and abs(height - 0.65) < 5e-3
    assert shortest - 0.1 < 80.0 < longest + 0.1 and abs(length - 80.0) < 0.3


@pytest.mark.slow
@pytest.mark.parametrize("told", ["cnc_probe"], indirect=True)
def test_a_probes_answers_tell_where_the_wire_ends(told: str) -> None:
    (line,) = [each for each in told.splitlines() if each.startswith("ridge-1: ")]
    found = numbers(line.replace("ridge-1", "ridge 1"))
    assert found[2] < 0.65 < found[3]
    ends = sorted([found[7:9], found[9:11]])  # an axis may be told from either of its ends
    assert len(found) == 11
    assert [*ends[0], *ends[1]] == pytest.approx([-7.468, -10.030, 15.468, 6.030], abs=0.1)  # as the scene states it


@pytest.mark.slow
@pytest.mark.parametrize("told", ["stylus_metrology"], indirect=True)
def test_a_stylus_tells_burrs_and_a_scratch_and_judges_them(told: str) -> None:
    found = {line.split(":")[0]: numbers(line.split(":", 1)[1]) for line in told.splitlines() if ", at " in line}
    sizes = {round(numbers[3], 2): (numbers[1], numbers[2], numbers[4]) for numbers in found.values()}
    assert sorted(sizes) == [1.1, 2.0, 3.0]
    assert sizes[2.0][0] < 0.5 < sizes[2.0][1] and sizes[2.0][2] < 0.05  # too high
    assert sizes[3.0][0] < 0.15 < sizes[3.0][1] and sizes[3.0][2] > 0.95
    assert 4.0 < sizes[1.1][0] < sizes[1.1][1] < 4.5 and sizes[1.1][2] > 0.95  # to a sample's distance at either rim
    assert "Ra " in told


@pytest.mark.slow
@pytest.mark.parametrize("told", ["own_detector"], indirect=True)
def test_detectors_are_held_against_each_other_at_one_rate_of_false_alarms(told: str) -> None:
    ours, mine = zip(*(numbers(line)[1:] for line in told.splitlines()), strict=True)
    assert len(ours) == 5 and max(ours[0], mine[0]) < 12.0  # 5 % asked; 200 sweeps scatter by 1.5 %
    assert ours[-1] > 95.0 and mine[-1] > 80.0
    assert ours[3] > mine[3]
