"""Setting up: the Makefile's stamps, the fallbacks of a bare machine, and the README's promises."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import get_args

import pytest

import explore3d

ROOT = Path(__file__).parents[1]

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="make and apt are not there")


def script(name: str) -> ModuleType:
    """A module of .ci, which is no package."""
    sys.path.insert(0, str(ROOT / ".ci"))
    try:
        spec = importlib.util.spec_from_file_location(f"ci_{name}", ROOT / ".ci" / f"{name}.py")
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module
    finally:
        sys.path.remove(str(ROOT / ".ci"))


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A copy of what make looks at, with a setup that only notes that it ran."""
    for name in ("Makefile", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path / name)
    (tmp_path / ".ci").mkdir()
    (tmp_path / ".venv").mkdir()
    (tmp_path / ".ci" / "setup.py").write_text("import sys\nopen('calls', 'a').write(' '.join(sys.argv[1:]) + ';')\n")
    return tmp_path


def make(folder: Path, *arguments: str) -> str:
    command = ["make", *arguments, f"PYTHON={sys.executable}"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout


needs_make = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")


@needs_make
def test_setting_up_twice_does_nothing_the_second_time(checkout: Path) -> None:
    make(checkout, "setup")
    make(checkout, "setup")
    assert (checkout / "calls").read_text() == ";"


@needs_make
def test_setting_up_for_the_tests_serves_the_demo_too(checkout: Path) -> None:
    make(checkout, "setup-dev")
    make(checkout, "setup")
    make(checkout, "setup-dev")
    assert (checkout / "calls").read_text() == "dev;"


@needs_make
def test_a_changed_dependency_is_installed(checkout: Path) -> None:
    make(checkout, "setup")
    later = (checkout / ".venv" / ".ready").stat().st_mtime + 10
    os.utime(checkout / "pyproject.toml", (later, later))
    make(checkout, "setup")
    assert (checkout / "calls").read_text() == ";;"


@needs_make
def test_the_demo_explores_once_and_then_only_says_where_the_report_is(checkout: Path) -> None:
    program = checkout / ".venv" / "bin" / "explore3d"
    program.parent.mkdir()
    program.write_text('#!/bin/sh\nmkdir -p "$4" && echo "$@" >> runs && touch "$4/report.html"\n')
    program.chmod(0o755)
    (checkout / "assets" / "scenes").mkdir(parents=True)
    (checkout / "assets" / "scenes" / "wire_on_plate.toml").write_text("")
    report = checkout / "out" / "wire_on_plate" / "report.html"
    for _ in range(2):
        assert str(report) in make(checkout, "demo")
    assert (checkout / "runs").read_text() == "run assets/scenes/wire_on_plate.toml --out out/wire_on_plate\n"


@needs_make
def test_the_demo_and_the_tests_are_the_commands_of_the_readme() -> None:
    commands = re.findall(r"^make (\S+)", (ROOT / "README.md").read_text(), re.M)
    assert commands == ["demo", "test"]
    for command in commands:
        assert make(ROOT, "--dry-run", command)


def test_the_readme_s_python_names_exist() -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(), re.M | re.S)
    assert len(blocks) == 3
    for block in blocks:
        lines = [line for line in block.splitlines() if line.strip()]
        assert len(lines) <= 5
        assert lines[0] == "import explore3d"
        compile(block, "README.md", "exec")
        for name in re.findall(r"explore3d\.(\w+)\(", block):
            assert callable(getattr(explore3d, name))


def test_every_key_of_a_scene_is_documented() -> None:
    from explore3d.scene.scene import Scene
    from explore3d.scene.values import Table

    def keys(table: type[Table]) -> set[str]:
        found = {info.alias or name for name, info in table.model_fields.items()}
        for info in table.model_fields.values():
            for kind in (info.annotation, *get_args(info.annotation)):
                if isinstance(kind, type) and issubclass(kind, Table):
                    found |= keys(kind)
        return found

    text = (ROOT / "docs" / "scene.md").read_text()
    named = set(re.findall(r"[a-z_]+", " ".join(re.findall(r"`([^`]*)`", text))))
    assert keys(Scene) <= named


def test_every_shipped_scene_is_documented() -> None:
    text = (ROOT / "docs" / "scene.md").read_text()
    assert all(f"`{path.name}`" in text for path in (ROOT / "assets" / "scenes").glob("*.toml"))


def test_the_continuous_integration_runs_make_test() -> None:
    path = ROOT / ".ci" / "run"
    assert os.access(path, os.X_OK)
    assert "make test" in path.read_text()
    subprocess.run(["bash", "-n", str(path)], check=True)


def test_an_environment_without_ensurepip_is_made_without_pip(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    setup = script("setup")
    monkeypatch.setattr(setup, "VENV", tmp_path / "venv")
    monkeypatch.setattr(setup, "PYTHON", tmp_path / "venv" / "bin" / "python")
    works = setup.works
    # what Debian's python3 without python3-venv does with "python3 -m venv"
    monkeypatch.setattr(setup, "works", lambda command: "venv" not in command and works(command))
    setup.make_environment()
    assert works([str(tmp_path / "venv" / "bin" / "python"), "-c", ""])
    assert not works([str(tmp_path / "venv" / "bin" / "python"), "-m", "pip", "--version"])


def test_without_any_pip_the_administrator_is_told_what_is_needed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    setup = script("setup")
    monkeypatch.setattr(setup, "works", lambda command: False)
    monkeypatch.setattr(setup.debian, "unpack", lambda packages: tmp_path)
    with pytest.raises(SystemExit, match="apt-get install python3-venv"):
        setup.pip()


def test_an_older_python_is_refused_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    setup = script("setup")
    monkeypatch.setattr(setup, "OLDEST", (99, 0))
    with pytest.raises(SystemExit, match="make PYTHON="):
        setup.main([])


@pytest.mark.skipif(sys.platform != "linux", reason="system libraries are a matter of Linux")
@pytest.mark.parametrize("allowed", [True, False])
def test_what_cannot_be_installed_is_unpacked_else_asked_for(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, allowed: bool
) -> None:
    libraries = script("system_libraries")
    lacking = {"libGL.so.1": "libgl1", "libX11.so.6": "libx11-6"}
    monkeypatch.setattr(
        libraries, "missing", lambda python, packages: [p for p in packages.values() if p in lacking.values()]
    )
    monkeypatch.setattr(libraries, "reason", lambda python: "libGL.so.1: cannot open shared object file")
    monkeypatch.setattr(libraries.debian, "install", lambda packages: allowed)
    asked: list[list[str]] = []
    monkeypatch.setattr(libraries, "unpack", lambda packages, folder: asked.append(packages))
    with pytest.raises(SystemExit) as end:
        libraries.provide(Path(sys.executable), tmp_path / "libs")
    assert asked == [["libgl1", "libx11-6"]]
    assert "libgl1 libx11-6" in str(end.value) or "libglvnd" in str(end.value)
    assert "cannot open shared object file" in str(end.value)


@pytest.mark.skipif(sys.platform != "linux", reason="system libraries are a matter of Linux")
def test_a_library_that_is_nowhere_is_missing_and_the_c_library_is_not() -> None:
    libraries = script("system_libraries")
    packages = {"libc.so.6": "libc6", "libnosuch.so.9": "libnosuch9"}
    assert libraries.missing(Path(sys.executable), packages) == ["libnosuch9"]


def test_unpacked_libraries_bear_the_names_that_programs_ask_for(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    libraries = script("system_libraries")
    folder = tmp_path / "files" / "usr" / "lib" / "x86_64-linux-gnu"
    folder.mkdir(parents=True)
    (folder / "libfoo.so.1.2.3").write_text("machine code")
    (folder / "libfoo.so.1").symlink_to("libfoo.so.1.2.3")
    monkeypatch.setattr(libraries.debian, "unpack", lambda packages: tmp_path / "files")
    libraries.unpack(["libfoo1"], tmp_path / "libs")
    assert [(path.name, path.read_text()) for path in (tmp_path / "libs").iterdir()] == [
        ("libfoo.so.1", "machine code")
    ]
