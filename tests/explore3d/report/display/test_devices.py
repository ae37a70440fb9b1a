"""Displays by name: the door for other people's devices, and the two commands."""

from __future__ import annotations

import json
import re
import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from typer.testing import CliRunner

from explore3d import UserError
from explore3d.cli.display import vibrate
from explore3d.cli.main import command_line
from explore3d.cli.options import point
from explore3d.report.display import devices, display_device
from explore3d.scene import examples as all_examples, load_scene
from hw.display import SimulatedDisplay
from mapping import Feature, Interval, ObjectModel, Support, Surface
from mapping.base import Base


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    corners = 0.03 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    axis = np.array([[0.0, -15e-3, 0.0], [0.0, 15e-3, 0.0]])
    size = Interval(0.2e-3, 0.19e-3, 0.21e-3)
    wire = Feature(
        "ridge",
        axis,
        np.tile([0.0, 0.0, 1.0], (2, 1)),
        size,
        size,
        Interval(30e-3, 29e-3, 31e-3),
        Support(9.0, 3),
        True,
        1e-6,
    )
    base = Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))
    ObjectModel.attach(base, [wire], provenance={"tip_radius": 5e-3}).save(tmp_path)
    return tmp_path


def test_an_installed_device_is_loaded_when_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("somebodys_device")
    module.Falcon = lambda: SimulatedDisplay([[0.0, 0.0, 0.0]])  # type: ignore[attr-defined]
    module.Nonsense = lambda: 3  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "somebodys_device", module)
    named = {"falcon": "Falcon", "nonsense": "Nonsense", "gone": "Gone"}
    points = {
        name: EntryPoint(name, f"somebodys_device:{value}", devices.DISPLAY_GROUP) for name, value in named.items()
    }
    monkeypatch.setattr(devices, "displays", lambda: points)
    assert isinstance(display_device("falcon"), SimulatedDisplay)
    with pytest.raises(UserError, match=r"gives no hw\.display\.Display; found int"):
        display_device("nonsense")
    with pytest.raises(UserError, match="cannot be loaded: AttributeError"):
        display_device("gone")
    with pytest.raises(UserError, match="possible: simulated, falcon, gone, nonsense"):
        display_device("omega")


def test_display_says_what_was_felt(folder: Path) -> None:
    told = CliRunner().invoke(
        command_line(), ["display", str(folder), "--fast", "--json", "--log", str(folder / "felt.mcap")]
    )
    assert told.exit_code == 0
    record = json.loads(told.stdout)
    assert record["reason"] == "done" and record["samples"] > 1000 and record["least_energy"] >= 0.0
    assert (folder / "felt.mcap").stat().st_size > 10_000


def test_vibrate_writes_each_format(folder: Path) -> None:
    for ending in ("wav", "ahap", "hjif"):
        out = folder / f"crossing.{ending}"
        path = "-6 mm, 0 mm, 0 mm; 6 mm, 0 mm, 0 mm"
        told = CliRunner().invoke(command_line(), ["vibrate", str(folder), "--path", path, "--out", str(out)])
        assert told.exit_code == 0 and "2 events" in told.stdout
        assert out.stat().st_size > 1000


def test_a_crossing_of_nothing_is_called_that_and_the_helps_own_crosses(folder: Path) -> None:
    beside = "-6 mm, 20 mm, 0 mm; 6 mm, 20 mm, 0 mm"
    words = ["vibrate", str(folder), "--path", beside, "--out", str(folder / "a.wav")]
    told = CliRunner().invoke(command_line(), words)
    assert told.exit_code == 0 and "the path crosses no feature" in told.stdout and "amplitude" not in told.stdout
    # the example of the help is over the example scene's plate, and crosses its wire
    example = re.search(r'--path "(.*?)"', vibrate.__doc__ or "")
    assert example is not None
    scene = load_scene(all_examples()["wire_on_plate"].scene)
    surface = scene.base_surface()
    assert surface is not None
    path = np.array([point("--path", each) for each in example[1].split(";")])
    apart = np.linalg.norm(path - Base(surface).foot(path, 0.0).points, axis=1)
    assert (apart < 5e-3).all()
    start, end = np.array(scene.truth[0].axis)[[0, -1]]
    sides = np.sign(np.cross(end - start, path - start) @ surface.face_normals[0])
    assert sides[0] != sides[1]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["display", "--device", "falcon"], "unknown display 'falcon'"),
        (["display", "--stiffness", "0"], "stiffness must be positive"),
        (["display", "--seconds", "0"], "--seconds"),
        (["display", "--exaggeration", "1000"], "from 1 to 100"),
        (["vibrate", "--path", "0 mm, 0 mm, 0 mm", "--out", "a.wav"], "at least two places"),
        (["vibrate", "--path", "0 mm, 0 mm, 0 mm; 1 mm, 0 mm, 0 mm", "--out", "a.wav", "--speed", "0 m/s"], "--speed"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(folder: Path, words: list[str], message: str) -> None:
    told = CliRunner().invoke(command_line(), [words[0], str(folder), *words[1:]])
    assert told.exit_code != 0 and message in str(told.exception)
