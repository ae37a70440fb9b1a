"""Files that a scene names: near it, or where a person says."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import pytest
from in_process import explore3d_main
from scene_files import MESHES

from explore3d.errors import SceneError
from explore3d.jobs.machines.reprobe import reprobe
from explore3d.jobs.run import open_scene
from explore3d.scene.begin import begin_scene
from explore3d.scene.finger import FingerTable
from explore3d.scene.named_files import NamedFiles, with_files
from explore3d.scene.scene import load_scene, recorded_scene
from explore3d.scene.values import Table

TEXT = """
schema = "explore3d/scene/1"
tip.radius = "10 mm"
model.mesh = "{mesh}"
finger.object = "{mesh}"
finger.rate = "200 Hz"
survey.smallest_feature = "1 mm"
explore.time_budget = "3 s"
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """project/scenes/mine/scene.toml; tiles lie all over."""
    folder = tmp_path / "project" / "scenes" / "mine"
    for place in (folder / "below", folder.parent / "meshes" / "deep", tmp_path / "elsewhere"):
        place.mkdir(parents=True)
    for place in (folder, folder / "below", folder.parent / "meshes" / "deep", folder.parent, tmp_path / "elsewhere"):
        (place / "tile.ply").write_bytes((MESHES / "tile.ply").read_bytes())
    return folder / "scene.toml"


def named(scene: Path, mesh: object) -> Path:
    scene.write_text(TEXT.format(mesh=mesh))
    return scene


@pytest.mark.parametrize("name", ["tile.ply", "below/tile.ply", "../meshes/deep/tile.ply", "../mine/tile.ply"])
def test_a_scene_names_files_below_and_beside_itself(scene: Path, name: str) -> None:
    found = load_scene(named(scene, name))
    assert found.model.mesh == (scene.parent / name).resolve() and found.base_surface() is not None
    assert found.files == (found.model.mesh,)


@pytest.mark.parametrize("name", ["../tile.ply", "../../../elsewhere/tile.ply", "{}/elsewhere/tile.ply", "{}/link/x"])
def test_others_are_refused_with_the_rule_and_the_way_out(scene: Path, tmp_path: Path, name: str) -> None:
    mesh = name.format(tmp_path)
    with pytest.raises(SceneError) as refused:
        load_scene(named(scene, mesh))
    place = (scene.parent / mesh).resolve()
    for said in (f"{scene}: model.mesh: {mesh} is {place}; ", "a folder beside", f"--files-from {place.parent}"):
        assert said in str(refused.value)
    if place.exists():
        assert load_scene(scene, files_from=[place.parent]).base_surface() is not None


def test_links_are_followed_before_a_file_is_judged(scene: Path, tmp_path: Path) -> None:
    (scene.parent / "link.ply").symlink_to(tmp_path / "elsewhere" / "tile.ply")
    with pytest.raises(SceneError, match="elsewhere"):
        load_scene(named(scene, "link.ply"))
    (scene.parent / "other").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(SceneError, match="elsewhere"):
        load_scene(named(scene, "other/tile.ply"))
    (scene.parent / "round.ply").symlink_to(scene.parent / "round.ply")
    with pytest.raises(SceneError, match=r"model\.mesh: "):
        load_scene(named(scene, "round.ply")).base_surface()


def test_beside_a_folder_at_the_root_lies_everything_and_nothing_is_near() -> None:
    files = NamedFiles.of(Path("/tmp/scene.toml"), ())
    assert files.place("model.mesh", Path("below/a.ply")) == Path("/tmp").resolve() / "below" / "a.ply"
    with pytest.raises(SceneError, match="--files-from /etc"):
        files.place("model.mesh", Path("../etc/passwd"))


class Logger(Table):
    """A device of somebody's package, with a file of its own."""

    calibration: Path


class TheirTable(FingerTable):
    """A finger of somebody's package."""

    kind: Literal["theirs"] = "theirs"
    wiring: Path
    logger: Logger
    more: tuple[Path, ...] = ()


def test_files_of_other_peoples_tables_are_judged_too(scene: Path) -> None:
    def table(wiring: str, calibration: str, more: str) -> TheirTable:
        return TheirTable(wiring=Path(wiring), logger=Logger(calibration=Path(calibration)), more=(Path(more),))

    place = NamedFiles.of(scene, ()).place
    found = with_files(table("a.txt", "../meshes/b.txt", "c.txt"), place, "finger.")
    assert found.logger.calibration == (scene.parents[1] / "meshes" / "b.txt").resolve()
    for bad, field in (
        (table("/etc/passwd", "b", "c"), "finger.wiring"),
        (table("a", "/etc/passwd", "c"), "finger.logger.calibration"),
        (table("a", "b", "../../../c"), "finger.more"),
    ):
        with pytest.raises(SceneError, match=field):
            with_files(bad, place, "finger.")


def test_a_recording_names_files_and_none_of_them_is_opened(scene: Path) -> None:
    recorded = recorded_scene(TEXT.format(mesh="/etc/passwd"), scene)
    assert recorded.model.mesh == Path("/etc/passwd")
    with pytest.raises(SceneError, match="named by a recording"):
        recorded.base_surface()


def test_a_session_goes_on_with_the_files_it_read_while_they_are_what_they_were(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh, out = tmp_path / "elsewhere" / "tile.ply", tmp_path / "far" / "out"
    named(scene, mesh)
    assert explore3d_main(monkeypatch, "run", scene, "--out", out) == 2
    assert "--files-from" in capsys.readouterr().err and not out.exists()
    # three seconds of finger time end before the survey does: status 3, and the way on names the folder again
    assert explore3d_main(monkeypatch, "run", scene, "--out", out, "--files-from", mesh.parent) == 3
    assert f"--files-from {mesh.parent} --resume" in capsys.readouterr().out
    assert explore3d_main(monkeypatch, "run", scene, "--out", out, "--files-from", mesh.parent, "--resume") == 3
    capsys.readouterr()
    assert open_scene(out / "scene.toml").model.mesh == mesh
    assert len(reprobe(out, (0.0, 0.0, 0.0), touches=1).felt) == 1
    mesh.write_bytes(mesh.read_bytes() + b"\n")
    with pytest.raises(SceneError, match="--files-from"):
        open_scene(out / "scene.toml")
    assert open_scene(out / "scene.toml", [mesh.parent]).model.mesh == mesh


def test_a_scene_to_begin_from_stands_beside_a_copy_of_its_mesh(scene: Path, tmp_path: Path) -> None:
    made = load_scene(begin_scene(tmp_path / "new", tmp_path / "elsewhere" / "tile.ply", "m", "5 mm"))
    assert made.model.mesh == (tmp_path / "new" / "tile.ply").resolve() and made.base_surface() is not None
