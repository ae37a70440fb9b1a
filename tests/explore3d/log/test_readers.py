"""Readers: every file is read by what it holds, its header's claims are checked, and nothing in it is carried out."""

from __future__ import annotations

import gzip
import io
import json
import pickle
import struct
import warnings
import zipfile
from collections.abc import Mapping
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from explore3d import UserError, analyze
from explore3d.log import Inspection, inspect, load_logs
from explore3d.log.readers import readers, registry
from mapping import Trace

RNG = np.random.default_rng(3)
POINTS = np.column_stack([np.tile(0.5 * np.arange(20), 4), np.repeat(9.0 * np.arange(4), 20), RNG.normal(0, 0.01, 80)])
CSV = "x,y,z\n" + "".join(f"{x!r},{y!r},{z!r}\n" for x, y, z in POINTS.tolist())
FIELDS = [("x", "<f8"), ("y", "<f8"), ("z", "<f8")]


def npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array, allow_pickle=True)
    return file.getvalue()


def npz(**arrays: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def zipped(**files: bytes) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name.replace("_", "."), content)
    return file.getvalue()


def ply(form: str = "binary_little_endian", count: int = 80, more: str = "") -> bytes:
    head = f"ply\nformat {form} 1.0\ncomment a scan\nelement vertex {count}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz") + more + "end_header\n"
    order = ">f8" if "big" in form else "<f8"
    body = CSV.partition("\n")[2].replace(",", " ").encode() if form == "ascii" else POINTS.astype(order).tobytes()
    return head.encode() + body


def pcd(form: str = "binary", count: int = 80) -> bytes:
    head = f"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {count}\nHEIGHT 1\n"
    head += f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA {form}\n"
    return head.encode() + (POINTS.tobytes() if form == "binary" else CSV.partition("\n")[2].replace(",", " ").encode())


KINDS = {
    "text": CSV.encode(),
    "gzip": gzip.compress(CSV.encode()),
    "gzip of gzip": gzip.compress(gzip.compress(CSV.encode())),
    "zip": zipped(scan_csv=CSV.encode()),
    "zip with a sidecar": zipped(scan_csv=CSV.encode(), scan_toml=b"units = 'mm'"),
    "gzip of npy": gzip.compress(npy(POINTS)),
    "npy": npy(POINTS),
    "npy, Fortran order": npy(np.asfortranarray(POINTS)),
    "npy of float32": npy(POINTS.astype(np.float32)),
    "npy of fields": npy(np.array([tuple(row) for row in POINTS.tolist()], dtype=FIELDS)),
    "npz": npz(points=POINTS),
    "npz of columns": npz(x=POINTS[:, 0], y=POINTS[:, 1], z=POINTS[:, 2]),
    "ply": ply(),
    "ply, big endian": ply("binary_big_endian"),
    "ply in text": ply("ascii"),
    "pcd": pcd(),
    "pcd in text": pcd("ascii"),
    "obj": b"# points\n" + b"".join(f"v {x!r} {y!r} {z!r}\n".encode() for x, y, z in POINTS.tolist()),
}


def written(folder: Path, content: bytes, name: str = "scan.dat") -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("suffix", ["dat", "mcap", "csv"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_file_is_read_by_what_it_holds_whatever_its_name(tmp_path: Path, kind: str, suffix: str) -> None:
    path = written(tmp_path, KINDS[kind], f"scan.{suffix}")
    log = load_logs([path], tip_radius="1 mm", units="mm")
    assert log.trace.centers == pytest.approx(1e-3 * POINTS, abs=1e-9 if "float32" in kind else 1e-17)
    assert np.unique(log.trace.sweep).tolist() == [0, 1, 2, 3]
    assert log.sources == (str(path),) and "80 rows in 4 sweeps" in log.metadata["read_as"][0]


class Trap:
    """Something that a pickle would carry out."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (Path.write_text, (Path("trap"), "caught"))


BAD = {
    "a pickle in npy": npy(np.array([Trap()], dtype=object)),
    "a pickle in npz": npz(x=np.array([Trap()], dtype=object)),
    "a pickle": pickle.dumps(Trap()),
    "npy of strings": npy(np.array([["a", "b"]])),
    "npy of one column": npy(POINTS[:, 0]),
    "npy transposed": npy(POINTS.T),
    "npy that claims too much": npy(POINTS).replace(b"(80, 3), }" + b" " * 10, b"(8000000000, 3), }  "),
    "npy cut": npy(POINTS)[:500],
    "npz of unequal columns": npz(x=POINTS[:, 0], z=POINTS[:9, 2]),
    "ply that claims too much": ply(count=4_000_000_000),
    "ply in text that claims too much": ply("ascii", count=4_000_000_000),
    "ply cut": ply()[:900],
    "ply without an end": ply()[:60],
    "ply with faces": ply(more="element face 3\nproperty list uchar int vertex_indices\n"),
    "ply of an unknown type": ply().replace(b"property double x", b"property quad x"),
    "pcd that claims too much": pcd(count=4_000_000_000),
    "pcd compressed": pcd().replace(b"DATA binary", b"DATA binary_compressed"),
    "obj with faces": KINDS["obj"] + b"f 1 2 3\n",
    "stl": bytes(80) + struct.pack("<I", 3) + (struct.pack("<12f", 0, 0, 1, *range(9)) + b"\0\0") * 3,
    "stl in text": b"solid x\n facet normal 0 0 1\n outer loop\n vertex 0 0 0\n",
    "a bomb in gzip": gzip.compress(bytes(80 * 2**20)),
    "a bomb in zip": zipped(scan_csv=bytes(80 * 2**20)),
    "gzip cut": gzip.compress(CSV.encode())[:200],
    "gzip damaged": gzip.compress(CSV.encode())[:300] + b"rubbish" + gzip.compress(CSV.encode())[307:],
    "zip cut": zipped(scan_csv=CSV.encode())[:200],
    "zip of two": zipped(a_csv=CSV.encode(), b_csv=CSV.encode()),
    "zip of nothing": zipped(),
    "a spreadsheet": zipped(**{"[Content_Types]_xml": b"<x/>"}) + b"",
    "empty": b"",
    "noise": RNG.bytes(5000),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_file_that_cannot_be_a_recording_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.chdir(tmp_path)
    path = written(tmp_path, BAD[kind])
    with pytest.raises(UserError) as error:
        load_logs([path], tip_radius="1 mm", units="mm")
    assert str(error.value).startswith(f"{path}: ") and "\n" not in str(error.value)
    assert not (tmp_path / "trap").exists()


@pytest.mark.parametrize("kind", ["npy", "npz", "ply", "pcd", "gzip", "zip"])
def test_damaged_files_end_in_one_line_or_in_points(tmp_path: Path, kind: str) -> None:
    rng = np.random.default_rng(11)
    for number in range(20):
        content = bytearray(KINDS[kind])
        if number % 2:
            del content[rng.integers(1, len(content)) :]
        else:
            content[rng.integers(0, min(len(content), 400))] ^= 1 << int(rng.integers(8))
        path = written(tmp_path, bytes(content))
        try:
            load_logs([path], tip_radius="1 mm", units="mm")
        except UserError as error:
            assert "\n" not in str(error)


class Outside:
    """A reader of another package."""

    name = "a file of another program"
    unsaid = ("everything",)

    def sniff(self, first: bytes) -> float:
        return 1.0 if first.startswith(b"OTHER") else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Trace:
        return Trace(np.arange(80.0), POINTS, np.zeros(80, dtype=np.int64), 1e-3)


def test_another_package_brings_its_reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = EntryPoint("other", f"{__name__}:Outside", "explore3d.readers")
    monkeypatch.setattr(EntryPoint, "load", lambda self: Outside)
    monkeypatch.setattr(registry, "entry_points", lambda group: [entry] if group == "explore3d.readers" else [])
    readers.cache_clear()
    try:
        log = load_logs([written(tmp_path, b"OTHER")])
    finally:
        readers.cache_clear()
    assert log.trace.centers.tolist() == POINTS.tolist() and log.trace.tip_radius == 1e-3


# --- inspect --------------------------------------------------------------------------------------------


def looked(folder: Path, content: str, **settings: Any) -> Inspection:
    return inspect(written(folder, content.encode(), "scan.csv"), **settings)


def test_inspect_needs_neither_units_nor_tip_radius_and_says_how_to_settle_both(tmp_path: Path) -> None:
    found = looked(tmp_path, CSV)
    assert (found.samples, found.sweeps, found.spacing) == (80, 4, pytest.approx(0.5, rel=0.01))
    assert found.tip_radius is None and not found.metres
    assert any("--units mm" in each for each in found.doubtful) and any(
        "--tip-radius" in each for each in found.doubtful
    )
    settled = looked(tmp_path, CSV, units="mm", tip_radius="1 mm")
    assert settled.doubtful == () and settled.extent[0] == pytest.approx(9.5e-3)


def test_inspect_tells_every_column_and_what_keeps_the_file_from_being_read(tmp_path: Path) -> None:
    rows = "".join(f"{k};{0.5 * k:.2f};{0.1 * (k % 3):.3f};ok;1\n" for k in range(30))
    found = looked(tmp_path, "n;foo [mm];bar [mm];remark;mark\n" + rows, tip_radius="1 mm")
    assert [column["is"] for column in found.columns[:2]] == ["counts the rows", "advances evenly"]
    assert found.columns[3]["is"].startswith("text") and found.columns[1]["unit"] == "mm"
    assert found.samples == 0 and "--columns" in found.doubtful[0]


def test_inspect_says_gaps_repeats_and_sentinels(tmp_path: Path) -> None:
    x = np.delete(0.5 * np.arange(60), slice(20, 40))
    rows = [f"{a:.2f};{-9999 if k == 5 else 0.01 * (k % 4):.3f}" for k, a in enumerate(x)]
    found = looked(tmp_path, "x [mm];z [mm]\n" + "\n".join([*rows, rows[-1]]) + "\n", tip_radius="1 mm")
    assert (found.gaps, found.duplicates, found.samples) == (1, 1, 39)
    assert "1 left out: z is -9999" in found.read_as and "far off" in found.columns[1]["is"]


def test_inspect_counts_in_words_and_gives_zero_no_sign(tmp_path: Path) -> None:
    said = "\n".join(looked(tmp_path, "x [mm];z [mm]\n0;-0\n0.5;-1\n1;-0.0\n2;-2\n").lines())
    said = said.replace(str(tmp_path), "")  # may hold a -0
    assert "-2 to 0:" in said and "-0" not in said.replace("-0.", "")
    assert "no gaps longer than" in said and "no repeated positions" in said and "(67 % of the steps down)" in said
    one = "\n".join(looked(tmp_path, "x [mm];z [mm]\n1;2\n").lines())
    assert "1 row in 1 sweep" in one


def test_what_has_one_row_is_refused_with_its_name(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"scan\.csv: .* found 1 sample$"):
        analyze(written(tmp_path, b"x,z\n1,2\n", "scan.csv"), tip_radius="1 mm", units="mm")
    four = written(tmp_path, b"x,z\n1,2\n2,2\n3,2.5\n4,2\n", "four.csv")
    with pytest.raises(UserError, match=r"four\.csv: the base of a profile needs at least 8 samples; found 4 samples$"):
        analyze(four, tip_radius="1 mm", units="mm")


def test_a_folder_that_is_no_session_is_refused_as_that(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no session is in that folder: it holds no log"):
        inspect(tmp_path)


def test_a_profile_too_coarse_to_show_anything_is_analysed_without_a_raw_warning(tmp_path: Path) -> None:
    x = np.arange(80) * 0.05
    rows = "".join(f"{a:.3f},{z:.7f}\n" for a, z in zip(x, RNG.normal(0.0, 1e-6, 80), strict=True))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = analyze(written(tmp_path, f"x,z\n{rows}".encode(), "c.csv"), tip_radius="2 um", units="mm", quick=True)
    assert not np.isfinite(found.detections.detection_limit)


def test_a_program_is_told_which_setting_or_file_it_got_wrong_and_sees_a_result_in_a_line(tmp_path: Path) -> None:
    path = written(tmp_path, CSV.encode(), "scan.csv")
    with pytest.raises(TypeError, match="no setting 'unit' of a recording; did you mean 'units'"):
        analyze(path, tip_radius="1 mm", unit="mm")
    with pytest.raises(TypeError, match=r"the name of a file; found ndarray; numpy\.save"):
        analyze(POINTS, tip_radius="1 mm")  # type: ignore[arg-type]
    said = repr(analyze(path, tip_radius="1 mm", units="mm", quick=True))
    assert said.startswith(
        "<Analysis of 'scan.csv': <LaidTrace: 80 samples in 4 sweeps of a tip of 1 mm>, <ObjectModel"
    )
    assert "\n" not in said


def test_inspect_as_json_is_json_and_as_text_is_lines(tmp_path: Path) -> None:
    from dataclasses import asdict

    found = looked(tmp_path, CSV)
    assert json.loads(json.dumps(asdict(found), allow_nan=False))["samples"] == 80
    assert any(line.startswith("read as: x = 'x'") for line in found.lines())


def test_what_is_nothing_at_all_is_refused_by_inspect_too(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no line of two or more numbers"):
        looked(tmp_path, "once upon a time\n")


DEKTAK = """Scan Parameters
Scan Type,Standard Scan
Stylus,Radius: 2.5 \xb5m
Length,1500.0 um
Resolution,0.156 um/sample

Analytical Results
Function,R.Cur Pos,R.Cur Width,M.Cur Pos,M.Cur Width,Result
Ra,468.0 um,0.0 um,733.0 um,0.0 um,0.00525 um

Scan Data
Lateral um,Raw Micrometer,
"""


def test_the_export_of_a_dektak_is_read_with_its_stylus(tmp_path: Path) -> None:
    """The form of a file that such an instrument wrote, whose rows end in two empty cells; numbers made up."""
    heights = np.round(0.01 * np.sin(0.1 * np.arange(300)), 5)
    rows = "".join(f"{0.2 * k:.1f},{z:.5f},,\n" for k, z in enumerate(heights))
    (tmp_path / "scan.csv").write_bytes((DEKTAK + rows).encode("latin-1"))
    log = load_logs([tmp_path / "scan.csv"])
    assert log.trace.tip_radius == pytest.approx(2.5e-6)
    assert log.trace.centers[:, 0] == pytest.approx(0.2e-6 * np.arange(300))
    assert log.trace.centers[:, 2] == pytest.approx(1e-6 * heights)


@pytest.mark.parametrize(
    ("words", "radius"),
    [
        ("# Tip radius: 2 um", 2e-6),
        ("Stylus radius (µm): 2,5", 2.5e-6),
        ("Tip radius;5;µm", 5e-6),
        ("Probe tip radius 2 um", 2e-6),
        ("Ball diameter: 6 mm", 3e-3),
    ],
)
def test_a_tip_radius_that_a_table_states_is_taken_and_said(tmp_path: Path, words: str, radius: float) -> None:
    (tmp_path / "scan.csv").write_text(f"{words}\nx [um];z [um]\n" + "".join(f"{k};{k % 7}\n" for k in range(90)))
    log = load_logs([tmp_path / "scan.csv"])
    assert log.trace.tip_radius == pytest.approx(radius) and len(log.trace) == 90
    assert log.metadata["read_as"][0].endswith("is stated in it")
    with pytest.raises(UserError, match="but the file states"):
        load_logs([tmp_path / "scan.csv"], tip_radius=2.0 * radius)


@pytest.mark.parametrize(
    "words", ["Tip radius: 2", "Tip radius: 2 um\nStylus radius: 5 um", "Tip radius: 0 um", "Tip radius: 3 V"]
)
def test_a_tip_radius_that_leaves_something_open_is_not_taken_and_that_is_said(tmp_path: Path, words: str) -> None:
    (tmp_path / "scan.csv").write_text(f"{words}\nx [um];z [um]\n" + "".join(f"{k};{k % 7}\n" for k in range(90)))
    with pytest.raises(UserError, match="tip_radius"):
        load_logs([tmp_path / "scan.csv"])
    log = load_logs([tmp_path / "scan.csv"], tip_radius="2 um")
    said = f"no radius was taken from {', '.join(map(repr, words.splitlines()))}"
    assert log.trace.tip_radius == 2e-6 and log.metadata["read_as"][0].endswith(said)


def test_what_speaks_of_a_tip_otherwise_is_no_radius(tmp_path: Path) -> None:
    words = "tip radius compensation: 3 mm\nstylus shaft diameter: 1 mm\nx [um];z [um];tip radius\n"
    (tmp_path / "scan.csv").write_text(words + "".join(f"{k};{k % 7};1\n" for k in range(90)))
    log = load_logs([tmp_path / "scan.csv"], tip_radius="2 um")
    assert "radius was" not in log.metadata["read_as"][0]
