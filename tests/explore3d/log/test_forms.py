"""One recording in every form in which people keep it: read as the same, whatever the file is called; or one line."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recordings import FORMS, RADIUS, Raster, raster

from explore3d import UserError
from explore3d.analysis import Stages, build_model
from explore3d.log import Log, inspect, load_logs
from explore3d.log.readers import optional
from mapping import Feature

SMALL, TINY = raster(12, 90), raster(6, 40)

# Of every three forms two are damaged in the slow suite alone
SOME_FORMS = [name if k % 3 == 0 else pytest.param(name, marks=pytest.mark.slow) for k, name in enumerate(FORMS)]


def written(name: str, log: Raster, path: Path) -> dict[str, Any]:
    """Write a form; the settings that read it. Skips where its library is missing."""
    if FORMS[name].needs:
        pytest.importorskip(FORMS[name].needs)
    return {"tip_radius": f"{RADIUS} mm"} | FORMS[name].write(log, path)


def test_there_are_more_than_forty_forms() -> None:
    assert len(FORMS) >= 55


@pytest.mark.parametrize(("suffix", "felt"), [("", SMALL), (".csv", TINY), (".mcap", TINY)], ids=["", ".csv", ".mcap"])
@pytest.mark.parametrize("name", FORMS)
def test_a_form_is_read_as_what_it_holds_whatever_its_name(
    tmp_path: Path, name: str, suffix: str, felt: Raster
) -> None:
    path = tmp_path / f"scan{suffix}"
    settings = written(name, felt, path)
    log = load_logs([path], **settings)
    assert log.trace.centers == pytest.approx(1e-3 * felt.points, abs=1e-3 * FORMS[name].step + 1e-14)
    assert np.array_equal(log.trace.sweep - log.trace.sweep[0], felt.sweep)
    assert log.trace.tip_radius == 1e-3 * RADIUS and log.sources == (str(path),)
    said = f"{len(felt.points)} rows in {felt.sweep[-1] + 1} sweeps"
    assert name == "our MCAP" or said in log.metadata["read_as"][0]
    if "LAS" in name or "LAZ" in name:
        assert log.trace.resolution == pytest.approx(1e-3 * FORMS[name].step)
        assert "grid of" in log.metadata["read_as"][0]
    looked = inspect(path, **settings)
    assert looked.samples == len(felt.points) and looked.doubtful == ()


@pytest.mark.parametrize("name", FORMS)
def test_what_a_form_does_not_say_is_asked_for_in_one_line(tmp_path: Path, name: str) -> None:
    path = tmp_path / "scan"
    settings = written(name, TINY, path)
    for key in settings:
        if key == "tip_radius" and name in ("our MCAP", "stylus text"):
            continue
        with pytest.raises(UserError) as error:
            load_logs([path], **{other: value for other, value in settings.items() if other != key})
        assert "\n" not in str(error.value) and str(path) in str(error.value)
        if key != "pixel":
            assert f"--{key.replace('_', '-')}" in str(error.value)


@pytest.mark.parametrize("name", SOME_FORMS)
def test_twenty_damaged_files_end_in_one_line_or_in_points(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "scan"
    settings = written(name, TINY, path)
    whole = path.read_bytes()
    rng = np.random.default_rng(11)
    for number in range(20):
        content = bytearray(whole)
        if number % 4 == 0:
            del content[rng.integers(1, len(content)) :]
        elif number % 4 == 1:
            content[rng.integers(0, min(len(content), 400))] ^= 1 << int(rng.integers(8))
        elif number % 4 == 2:
            content[rng.integers(0, len(content))] ^= 1 << int(rng.integers(8))
        else:
            place = int(rng.integers(0, len(content) - 8))
            content[place : place + 8] = b"\xff" * 8
        path.write_bytes(bytes(content))
        try:
            load_logs([path], **settings)
        except UserError as error:
            assert "\n" not in str(error) and str(path) in str(error)
    assert {each.name for each in tmp_path.iterdir()} <= {"scan", "scan.made"}


@pytest.mark.parametrize(
    ("form", "module", "extra"),
    [
        ("LAS", "laspy", "formats"),
        ("Parquet, none", "pyarrow", "formats"),
        ("XLSX", "openpyxl", "formats"),
        ("X3P, map", "x3pio", "formats"),
        ("GWY", "SurfaceTopography", "instruments"),
        ("ROS 1 bag, PoseStamped", "rosbags", "ros"),
    ],
)
def test_a_missing_library_is_named_with_the_command_that_installs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str, module: str, extra: str
) -> None:
    settings = written(form, SMALL, tmp_path / "scan")

    def missing(name: str) -> Any:
        if name.startswith(module):
            raise ImportError(name)
        return importlib.import_module(name)

    monkeypatch.setattr(optional, "import_module", missing)
    with pytest.raises(UserError) as error:
        load_logs([tmp_path / "scan"], **settings)
    assert f'pip install "explore3d[{extra}]"' in str(error.value) and "\n" not in str(error.value)


def test_a_stylus_that_the_file_states_must_agree_with_the_one_given(tmp_path: Path) -> None:
    written("stylus text", SMALL, tmp_path / "scan")
    assert load_logs([tmp_path / "scan"]).trace.tip_radius == pytest.approx(1e-3)
    with pytest.raises(UserError, match=r"states a stylus of 0\.001 m"):
        load_logs([tmp_path / "scan"], tip_radius="2 um")


def test_forces_beside_poses_are_read(tmp_path: Path) -> None:
    settings = written("ROS 2 bag, PoseStamped", SMALL, tmp_path / "scan")
    log = load_logs([tmp_path / "scan"], **settings)
    assert log.trace.force == pytest.approx(np.tile([0.0, 0.0, 1.5], (len(SMALL.points), 1)))
    assert "positions of /tip in frame 'base'" in log.metadata["read_as"][0]


NINETY = 2 * 1.6449  # standard deviations in a central interval of 90 %


KNOWN_TIP = "0 mm"  # a log of ours states its tip, a table's is doubted unless somebody says otherwise


def features_of(log: Log) -> tuple[Feature, ...]:
    return build_model(log, None, None, Stages()).model.features


@pytest.mark.slow
def test_a_log_of_1e5_samples_gives_the_same_features_in_every_form(tmp_path: Path) -> None:
    """Within 1 % of their standard deviations, or the file's quantisation is stated."""
    large = raster(50, 2000)
    path = tmp_path / "first"
    settings = written("our MCAP", large, path)
    truth = features_of(load_logs([path], tip_sd=KNOWN_TIP, **settings))
    assert len(truth) == 1
    known: dict[bytes, tuple[Feature, ...]] = {}
    counted = 0
    for name in FORMS:
        path = tmp_path / f"form {counted}"
        try:
            settings = written(name, large, path)
        except pytest.skip.Exception:
            continue
        log = load_logs([path], tip_sd=KNOWN_TIP, **settings)
        assert len(log.trace) == 100_000, name
        assert log.trace.centers == pytest.approx(1e-3 * large.points, abs=1e-3 * FORMS[name].step + 1e-14, rel=0)
        key = log.trace.centers.tobytes()
        found = known.setdefault(key, ()) or features_of(log)
        known[key] = found
        assert len(found) == len(truth), name
        for one, other in zip(found, truth, strict=True):
            for size in ("height", "width"):
                a, b = getattr(one, size), getattr(other, size)
                off = abs(a.median - b.median) / ((b.high - b.low) / NINETY)
                stated = "grid of" in log.metadata.get("read_as", [""])[0]
                print(f"{name}: {size} off by {off:.2g} sd{', grid stated' if stated else ''}", flush=True)
                assert off < 0.01 or stated, (name, size, off)
        counted += 1
        path.unlink()
    assert counted >= 40


def test_a_table_is_vouched_for_by_who_says_so(tmp_path: Path) -> None:
    path = tmp_path / "robot.csv"
    path.write_text("x,y,z\n" + "\n".join(f"{x},{y},{z}" for x, y, z in SMALL.points) + "\n")
    told: dict[str, Any] = {"tip_radius": 1e-3, "units": "mm"}
    assert not load_logs([path], **told).in_contact
    assert load_logs([path], in_contact=True, **told).in_contact
    path.with_suffix(".toml").write_text("in_contact = true\n")
    assert load_logs([path], **told).in_contact
    path.with_suffix(".toml").write_text('in_contact = "perhaps"\n')
    with pytest.raises(UserError, match=r"robot\.toml: in_contact"):
        load_logs([path], **told)


def test_one_force_alone_is_what_presses(tmp_path: Path) -> None:
    rows = "\n".join(f"{x},{y},{z},1.5" for x, y, z in SMALL.points)
    path = tmp_path / "pressed.csv"
    path.write_text(f"x,y,z,fz\n{rows}\n")
    log = load_logs([path], tip_radius=1e-3, units="mm")
    assert log.trace.force == pytest.approx(np.tile([0.0, 0.0, 1.5], (len(SMALL.points), 1)))
    assert "fz alone" in log.metadata["read_as"][0]
    path.write_text("x,y,z,fx,fy\n" + "\n".join(f"{x},{y},{z},0.1,0.2" for x, y, z in SMALL.points) + "\n")
    with pytest.raises(UserError, match="force need fx, fy, fz; found fx, fy"):
        load_logs([path], tip_radius=1e-3, units="mm")
