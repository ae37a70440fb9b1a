"""Packages of others, as the examples show them: installed, they are named in a scene, and conform."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from explore3d.errors import SceneError
from explore3d.scene.finger import kinds
from explore3d.scene.scene import load_scene, parse_scene

ROOT = Path(__file__).resolve().parents[1]
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
        "        print(done.returncode, done.stdout.splitlines()[:1], done.stderr[-300:])\n"
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
