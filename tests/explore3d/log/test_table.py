"""Tables of positions: whatever the instrument wrote is understood, or refused in one line."""

from __future__ import annotations

import importlib
import sys
import time
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from explore3d.errors import UserError
from explore3d.log import inspect
from explore3d.log.load import load_logs
from explore3d.log.own.record import Log
from explore3d.log.table import read_table
from explore3d.log.text import read_pieces, read_text
from explore3d.log.text.cell_kernels import read_cells

STYLUS = Path(__file__).parents[4] / "shared" / "data" / "stylus_profile_mm.csv"


def table(folder: Path, content: str | bytes, name: str = "scan.csv") -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def read(folder: Path, content: str | bytes, **options: object) -> Log:
    return read_table(table(folder, content), **({"units": "mm", "tip_radius": "1 mm"} | options))  # type: ignore[arg-type]


def refused(folder: Path, content: str | bytes, *said: str, **options: object) -> None:
    with pytest.raises(UserError) as error:
        read(folder, content, **options)
    message = str(error.value)
    assert "scan.csv" in message and "\n" not in message
    for part in said:
        assert part in message, message


@pytest.mark.skipif(not STYLUS.exists(), reason=f"needs {STYLUS}")
def test_the_stylus_scan_is_read_as_one_profile_in_metres() -> None:
    log = read_table(STYLUS, units="mm", tip_radius="2 um")
    assert len(log.trace) == 9600 and log.trace.tip_radius == pytest.approx(2e-6)
    assert log.trace.centers[0].tolist() == [8.672200 * 1e-3, 0.0, 106.606853 * 1e-3]
    assert np.diff(log.trace.centers[:, 0]) == pytest.approx(0.5e-6, rel=1e-6)
    assert np.unique(log.trace.sweep).tolist() == [0]
    assert log.metadata["columns"] == {"x": "X", "z": "Y", "valid": "valid"}
    assert log.complete and log.recovered == "" and len(log.sha256) == 64


SAME = [
    "x,y,z\n1,2,3\n4,5,6\n",
    "x;y;z\n1;2;3\n4;5;6\n",
    "1 2 3\n4 5 6\n",
    "  1\t2   3 \r\n\r\n 4 5 6\r\n",
    "1\t2\t3\n4\t5\t6",
    "# scan of a plate\n# x y z\n1 2 3\n# a break\n4 5 6\n",
    "% comment, with commas\n1,2,3\n4,5,6\n",
    "z;x;y\n3;1;2\n6;4;5\n",
    "X [mm];Y [mm];Z [mm]\n1,0;2,0;3,0\n4,0;5,0;6,0\n",
    "x (mm) y (mm) z (mm)\n1 2 3\n4 5 6\n",
    "x;y;z\nmm;mm;mm\n1;2;3;\n4;5;6;\n",
    '"x","y","z"\n"1","2","3"\n"4","5","6"\n',
    "Instrument: X9\nDate 2020-01-01, 12:00\n\nx,y,z\n1,2,3\n4,5,6\n",
    "\ufeffx,y,z\n1e0,+2.,3.0E0\n4,5,6\n",
    "index,x,y,z,remark\n0,1,2,3,7\n1,4,5,6,8\n",
]


@pytest.mark.parametrize("content", SAME)
def test_however_it_is_written_it_is_the_same_table(tmp_path: Path, content: str) -> None:
    trace = read(tmp_path, content).trace
    assert trace.centers.tolist() == [[1e-3, 2e-3, 3e-3], [4e-3, 5e-3, 6e-3]]


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1", "utf-8"])
def test_encodings_of_instruments_are_understood(tmp_path: Path, encoding: str) -> None:
    trace = read(tmp_path, "x [µm]\tz [µm]\n1\t2\n3\t4\n".encode(encoding), units=None).trace
    assert trace.centers == pytest.approx(np.array([[1e-6, 0, 2e-6], [3e-6, 0, 4e-6]]))


@settings(max_examples=40, deadline=None)
@given(
    rows=st.lists(st.tuples(*[st.floats(-1e12, 1e12)] * 3), min_size=1, max_size=7),
    delimiter=st.sampled_from([",", ";", "\t", " ", ";comma"]),
)
def test_numbers_written_in_full_come_back_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[float, float, float]], delimiter: str
) -> None:
    lines = [delimiter[0].join(repr(value) for value in row) for row in rows]
    text = "\n".join(lines).replace(".", ",") if delimiter == ";comma" else "\n".join(lines)
    path = table(tmp_path_factory.mktemp("table"), text)
    decimal = "," if delimiter == ";comma" else "."
    trace = read_table(path, units="m", tip_radius=1.0, jump=1e30, decimal=decimal).trace
    assert trace.centers.tolist() == [list(row) for k, row in enumerate(rows) if k == 0 or row != rows[k - 1]]


def test_rows_that_say_again_what_the_one_before_said_are_left_out(tmp_path: Path) -> None:
    lines = [f"{k},{0.1 * k},{0.01 * (k % 7):.2f},{k // 10}" for k in range(40)]
    once = read(tmp_path, "x,y,z,sweep\n" + "\n".join(lines) + "\n")
    thrice = read(tmp_path, "x,y,z,sweep\n" + "\n".join(line for line in lines for _ in range(3)) + "\n")
    assert np.array_equal(thrice.trace.centers, once.trace.centers)
    assert np.array_equal(thrice.trace.sweep, once.trace.sweep)
    assert "80 of 120 rows repeat the one before and are left out" in thrice.recovered
    assert (thrice.metadata["rows_left_out"], thrice.metadata["rows_repeated"]) == (80, 80)
    # the same place in another sweep is another reading
    again = read(tmp_path, "x,y,z,sweep\n0,0,0,0\n1,0,0,0\n1,0,0,1\n0,0,0,1\n")
    assert len(again.trace) == 4


def test_units_come_from_the_header_even_if_they_differ(tmp_path: Path) -> None:
    trace = read(tmp_path, "x [mm];z [um];t [ms]\n1;2;3\n4;5;6\n", units=None).trace
    assert trace.centers == pytest.approx(np.array([[1e-3, 0, 2e-6], [4e-3, 0, 5e-6]]))
    assert trace.t == pytest.approx([3e-3, 6e-3])
    trace = read(tmp_path, "1;2\n4;5\n", units={"x": "mm", "z": "um"}).trace
    assert trace.centers == pytest.approx(np.array([[1e-3, 0, 2e-6], [4e-3, 0, 5e-6]]))


def test_the_hint_of_columns_names_as_many_as_there_are(tmp_path: Path) -> None:
    header = "Länge a [mm];Breite b [mm];Höhe c [mm]"
    rows = [f"{i % 9};{i // 9};{0.1 * (i % 4):.1f}" for i in range(81)]
    refused(tmp_path, "\n".join([header, *rows]), '--columns "x=1, y=2, z=3"')
    two = [f"{i};{0.1 * (i % 4):.1f}" for i in range(81)]
    refused(tmp_path, "\n".join(["Länge a [mm];Höhe c [mm]", *two]), '--columns "x=1, z=2"')
    marked = [f"{i % 2};{row}" for i, row in enumerate(rows)]
    refused(tmp_path, "\n".join([f"gültig;{header}", *marked]), '--columns "x=2, y=3, z=4"')


def test_units_that_nobody_or_two_state_are_refused(tmp_path: Path) -> None:
    refused(tmp_path, "1;2\n3;4\n", "field units", "--units mm", units=None)
    refused(tmp_path, "x [um];z [um]\n1;2\n3;4\n", "field units", "'mm'", "'um'")
    refused(tmp_path, "1;2\n3;4\n", "units", "unknown unit", units="mmm")
    refused(tmp_path, "1;2\n3;4\n", "units", "'deg' is a unit of angle", units="deg")


def test_a_missing_tip_radius_says_how_to_give_it(tmp_path: Path) -> None:
    refused(tmp_path, "1;2\n3;4\n", "field tip_radius", "--tip-radius", "scan.csv.toml", tip_radius=None)


@pytest.mark.parametrize(("radius", "said"), [("-2 um", "greater than 0"), ("2", "unit missing"), ("2 kg", "unknown")])
def test_a_wrong_tip_radius_is_refused(tmp_path: Path, radius: str, said: str) -> None:
    refused(tmp_path, "1;2\n3;4\n", "tip_radius", said, tip_radius=radius)


def test_rows_that_are_invalid_or_lack_a_number_are_left_out_counted_and_said(tmp_path: Path) -> None:
    content = "x;z;valid\n1;1;1\n2;;1\n3;nan;1\n4;4;0\n5;5;1\n6;inf;1\n7;7;0\n8;8;\n"
    log = read(tmp_path, content)
    assert log.trace.centers[:, 0].tolist() == [1e-3, 5e-3]
    assert "3 of 8 rows are marked invalid" in log.recovered and "3 of 8 rows lack a number" in log.recovered
    assert log.metadata["rows"] == 8 and log.metadata["rows_left_out"] == 6
    assert np.unique(log.trace.sweep).tolist() == [0]


def test_rows_without_a_number_at_the_beginning_are_counted_like_all_others(tmp_path: Path) -> None:
    rows = "".join(f"{0.1 * k:.1f},{'nan' if k in (0, 1, 5) else 0.2}\n" for k in range(20))
    log = read(tmp_path, "# units: mm\nPosition,Height\n" + rows)
    assert len(log.trace) == 17 and "3 of 20 rows lack a number" in log.recovered


def test_heights_alone_are_a_profile_if_their_distance_is_said(tmp_path: Path) -> None:
    text = "z (um)\n" + "".join(f"{value:.1f}\n" for value in range(20))
    refused(tmp_path, text, "no line of two or more numbers", '--pixel "0.5 um"')
    log = read(tmp_path, text, pixel="0.5 um", units=None)
    assert np.allclose(log.trace.centers[:, 0], 0.5e-6 * np.arange(20))
    assert np.allclose(log.trace.centers[:, 2], 1e-6 * np.arange(20))
    assert "a profile of 20 heights at 0.5 µm" in log.metadata["read_as"][0]
    refused(tmp_path, text, "'mm' is asked for, but the file states 'um'", pixel="0.5 um", units="mm")


def test_a_map_is_recognised_as_one_in_a_line_that_can_be_read(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    text = "".join(" ".join(f"{value:.4f}" for value in row) + "\n" for row in rng.normal(size=(12, 400)))
    with pytest.raises(UserError, match=r"15, 16 and 384 more; .* a map of heights, .* --pixel") as error:
        read(tmp_path, text, units="mm")
    assert len(str(error.value)) < 500 + len(str(tmp_path))


def test_a_table_without_times_says_that_no_clock_went_with_it(tmp_path: Path) -> None:
    rows = [f"{k},{k % 3}.5" for k in range(20)]
    assert not read(tmp_path, "x,z\n" + "\n".join(rows)).timed
    assert read(tmp_path, "t,x,z\n" + "\n".join(f"{0.1 * k:.1f},{row}" for k, row in enumerate(rows))).timed


def test_a_unit_that_the_user_tells_is_said_by_its_name(tmp_path: Path) -> None:
    log = read(tmp_path, "x,z\n" + "".join(f"{k},{k % 3}.5\n" for k in range(20)), units="mm")
    assert log.metadata["read_as"][0].startswith("x = 'x' mm (as told), z = 'z' mm (as told), 20 rows")


def test_a_table_with_no_sample_left_is_refused(tmp_path: Path) -> None:
    refused(tmp_path, "x;z;valid\n1;1;0\n2;2;0\n", "samples", "2 of 2 rows are marked invalid")
    refused(tmp_path, "x;y;z\n1;1;nan\n2;2;\n", "samples", "2 of 2 rows lack a number")
    refused(tmp_path, "x;y;z\n", "no line of two or more numbers")


def test_an_incomplete_last_line_is_left_out_and_said(tmp_path: Path) -> None:
    log = read(tmp_path, "1;2;3\n4;5;6\n7;8")
    assert len(log.trace) == 2 and not log.complete and "last line was incomplete" in log.recovered


def test_a_cell_that_is_no_number_is_named_by_line_and_column(tmp_path: Path) -> None:
    refused(tmp_path, "x;z\n1;2\n3;4\n5;six\n7;8\n", "line 4, column 2", "'six'")
    refused(tmp_path, "1 2 3\n4 5\n6 7 8\n", "line 2", "expected 3 columns; found 2")
    refused(tmp_path, "1;2;3\n4;5;6\n7;0\n1;2;3\n", "line 3", "expected 3 columns; found 2")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty"),
        (b" \n\n", "is empty"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "PNG image"),
        (b"PK\x03\x04 spreadsheet", "export it as CSV"),
        (b"1;2\n\0\0;3", "binary"),
        (b"once upon a time\nthere was", "once upon a time"),
        (b"1\n2\n3\n", "two or more numbers"),
    ],
)
def test_files_that_are_no_tables_are_refused(tmp_path: Path, content: bytes, said: str) -> None:
    refused(tmp_path, content, said)


def test_missing_files_and_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"none\.csv: cannot read it"):
        read_table(tmp_path / "none.csv", units="mm", tip_radius=1.0)
    with pytest.raises(UserError, match="cannot read it"):
        read_table(tmp_path, units="mm", tip_radius=1.0)


# --- columns --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("columns", ["x=pos,z=Total", {"x": 2, "z": 4}, "x=2, z=4", {"x": "POS", "z": "total"}])
def test_columns_can_be_said(tmp_path: Path, columns: object) -> None:
    log = read(tmp_path, "n;pos;rough;Total\n0;1;9;2\n1;3;9;4\n", columns=columns)
    assert log.trace.centers.tolist() == [[1e-3, 0, 2e-3], [3e-3, 0, 4e-3]]


def test_columns_that_cannot_be_told_apart_or_do_not_exist_are_refused(tmp_path: Path) -> None:
    content = "n;pos;rough;Total\n0;1;9;2\n1;3;9;4\n"
    refused(tmp_path, content, "field columns", "'pos'", "--columns")
    refused(tmp_path, content, "columns.z", "did you mean 'Total'?", columns="x=pos,z=Totl")
    refused(tmp_path, content, "columns.x", "no column 5", "1 to 4", columns="x=5,z=1")
    refused(tmp_path, content, "columns", "expected", columns="pos")
    refused(tmp_path, content, "columns", "'w'", columns="w=pos,z=Total")
    refused(tmp_path, content, "x and z", columns="x=pos")


def test_contact_data_is_read_if_all_three_parts_are_there(tmp_path: Path) -> None:
    head = "t,x,y,z,nx,ny,nz,fx,fy,fz,cx,cy,cz\n"
    trace = read(tmp_path, head + "0,1,2,3,0,0,1,0,0,2,1,2,2\n1,2,2,3,0,0,1,0,0,2,2,2,2\n").trace
    assert trace.normals is not None and trace.normals.tolist() == [[0, 0, 1]] * 2
    assert trace.force is not None and trace.force.tolist() == [[0, 0, 2]] * 2
    assert trace.contacts is not None and trace.contacts.tolist() == [[1e-3, 2e-3, 2e-3], [2e-3] * 3]
    refused(tmp_path, "x,y,z,nx,ny\n1,2,3,0,0\n", "normals need nx, ny, nz")


def test_a_profile_that_does_not_advance_is_refused(tmp_path: Path) -> None:
    refused(tmp_path, "x;z\n1;1\n1;2\n1;3\n", "field x", "advances")


# --- sweeps ---------------------------------------------------------------------------------------------


def raster(noise: float = 0.0, back_and_forth: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Five lines of 200 points 0.1 apart, 3 from line to line; (points, number of the line)."""
    rng = np.random.default_rng(5)
    along, lines = np.arange(200) * 0.1, np.arange(5)
    x = np.concatenate([along[::-1] if back_and_forth and line % 2 else along for line in lines])
    points = np.column_stack([x, np.repeat(lines * 3.0, 200), np.zeros(1000)])
    return points + noise * rng.normal(size=points.shape), np.repeat(lines, 200)


def rows(points: np.ndarray) -> str:
    return "\n".join(" ".join(map(repr, row)) for row in points.tolist())


@pytest.mark.parametrize("back_and_forth", [False, True])
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_sweeps_are_cut_where_the_finger_jumped(tmp_path: Path, back_and_forth: bool, noise: float) -> None:
    points, line = raster(noise, back_and_forth)
    assert np.array_equal(read(tmp_path, rows(points)).trace.sweep, line)


@pytest.mark.parametrize("back_and_forth", [False, True])
def test_a_wall_that_a_row_climbs_from_one_sample_to_the_next_does_not_cut_it(
    tmp_path: Path, back_and_forth: bool
) -> None:
    points, line = raster(0.0, back_and_forth)
    points[:, 2] = np.where(points[:, 0] > 10.0, 2.0, 0.0)
    assert np.array_equal(read(tmp_path, rows(points)).trace.sweep, line)


def test_a_level_of_zeros_below_a_high_wall_is_not_left_out(tmp_path: Path) -> None:
    """Read without noise it repeats, and stands far off all others: they repeat as well. A machine that writes 0 where
    it has nothing does so amid readings that differ."""
    x = np.arange(0.0, 20.0, 0.05)
    z = np.where(
        x < 9.7, 0.0, 4.0 - np.maximum(0.5 - np.sqrt(np.maximum(0.25 - np.minimum(x - 10.2, 0.0) ** 2, 0.0)), 0.0)
    )
    log = read(tmp_path, "x_mm,z_mm\n" + "\n".join(f"{a!r},{b!r}" for a, b in zip(x.tolist(), z.tolist(), strict=True)))
    assert len(log.trace) == len(x)
    noisy = np.where(z > 0.0, z + np.random.default_rng(1).normal(0.0, 1e-3, len(z)), 0.0)
    log = read(
        tmp_path, "x_mm,z_mm\n" + "\n".join(f"{a!r},{b!r}" for a, b in zip(x.tolist(), noisy.tolist(), strict=True))
    )
    assert len(log.trace) == np.count_nonzero(z)


def test_noise_much_larger_than_the_spacing_does_not_cut_sweeps(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    points = np.column_stack([np.arange(20_000) * 6e-3, *rng.normal(0, 0.2, (2, 20_000))])
    assert np.unique(read(tmp_path, "x y z\n" + rows(points)).trace.sweep).tolist() == [0]


def test_a_length_of_jump_can_be_said(tmp_path: Path) -> None:
    points, _ = raster()
    assert np.unique(read(tmp_path, rows(points), jump="25 mm").trace.sweep).tolist() == [0]
    assert len(np.unique(read(tmp_path, rows(points), jump="0.05 mm").trace.sweep)) == 1000


def test_a_sweep_column_wins(tmp_path: Path) -> None:
    log = read(tmp_path, "x,y,z,Line\n1,2,3,7\n1,2,4,7\n1,2,5,9\n")
    assert log.trace.sweep.tolist() == [7, 7, 9]
    refused(tmp_path, "x,y,z,sweep\n1,2,3,7.5\n", "field sweep", "7.5")


# --- sidecar and frame ----------------------------------------------------------------------------------

SIDECAR = """
units = "um"
tip_radius = "5 um"
columns = { x = "a", z = "b" }
reference = "bottom"

[frame]
origin = ["1 mm", 0, 0]
rotation = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
"""


@pytest.mark.parametrize("name", ["scan.toml", "scan.csv.toml"])
def test_a_sidecar_says_what_the_file_does_not(tmp_path: Path, name: str) -> None:
    table(tmp_path, SIDECAR, name)
    log = read_table(table(tmp_path, "a b\n1 2\n3 4\n"))
    assert log.trace.tip_radius == pytest.approx(5e-6)
    assert log.trace.centers == pytest.approx(np.array([[1e-3, 1e-6, 7e-6], [1e-3, 3e-6, 9e-6]]))
    assert log.metadata["sidecar"] == str(tmp_path / name)


def test_options_win_over_the_sidecar(tmp_path: Path) -> None:
    table(tmp_path, SIDECAR, "scan.csv.toml")
    assert load_logs([table(tmp_path, "a b\n1 2\n3 4\n")], tip_radius="1 mm").trace.tip_radius == 1e-3


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("tip_radus = '1 mm'", "did you mean 'tip_radius'?"),
        ("tip_radius = 'x'", "tip_radius"),
        ("tip_radius =", "not TOML"),
        ("[frame]\nrotation = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]", "frame.rotation"),
        ("[frame]\norign = [0, 0, 0]", "did you mean 'origin'?"),
        ("reference = 'top'", "reference"),
    ],
)
def test_a_wrong_sidecar_is_named_with_the_field(tmp_path: Path, text: str, said: str) -> None:
    sidecar = table(tmp_path, text, "scan.toml")
    with pytest.raises(UserError) as error:
        read(tmp_path, "1 2\n3 4\n")
    assert str(sidecar) in str(error.value) and said in str(error.value) and "\n" not in str(error.value)


def test_a_scene_beside_the_table_is_no_sidecar(tmp_path: Path) -> None:
    table(tmp_path, 'schema = "explore3d/scene/1"\n[tip]\nradius = "1 mm"', "scan.toml")
    assert read(tmp_path, "1 2\n3 4\n").metadata["sidecar"] is None


def test_a_frame_turns_directions_but_does_not_move_them(tmp_path: Path) -> None:
    frame = {"origin": (1.0, 2.0, 3.0), "rotation": [[0, 0, 1], [1, 0, 0], [0, 1, 0]]}
    trace = read(tmp_path, "x y z nx ny nz cx cy cz\n1 2 3 1 0 0 4 5 6\n", units="m", frame=frame).trace
    assert trace.centers.tolist() == [[4.0, 3.0, 5.0]]
    assert trace.normals is not None and trace.normals.tolist() == [[0.0, 1.0, 0.0]]
    assert trace.contacts is not None and trace.contacts.tolist() == [[7.0, 6.0, 8.0]]


# --- several, and many ----------------------------------------------------------------------------------


def test_several_tables_merge_into_sweeps(tmp_path: Path) -> None:
    paths = [table(tmp_path, "1 2\n3 4\n", f"{name}.txt") for name in "ab"]
    log = load_logs(paths, tip_radius="1 mm", units="mm")
    assert log.trace.sweep.tolist() == [0, 0, 1, 1] and log.sources == tuple(map(str, paths))


@pytest.mark.slow
def test_a_million_rows_are_read_in_a_second(tmp_path: Path) -> None:
    """Rows of a raster: 1e6 of them took 1.2 CPU s at first, and 0.5 now; the kernels are compiled beforehand."""
    side = np.arange(1000)
    x, y = np.tile(1e-3 * side, 1000), np.repeat(0.1 * side, 1000)
    z = 1e-3 * np.random.default_rng(0).normal(size=len(x))
    table = tmp_path / "scan.csv"
    np.savetxt(table, np.column_stack([x, y, z]), fmt="%.6f", delimiter=";")
    spent = []
    for _ in range(3):
        start = time.process_time()
        assert len(read_table(table, units="mm", tip_radius=1.0).trace) == 1_000_000
        spent.append(time.process_time() - start)
    assert min(spent) < 1.0


def test_a_byte_order_mark_is_no_part_of_a_table_or_its_sidecar(tmp_path: Path) -> None:
    rows = "x,z\n" + "".join(f"{0.1 * k:.1f},{k % 3}\n" for k in range(20))
    (tmp_path / "scan.csv.toml").write_bytes(b"\xef\xbb\xbfunits = 'mm'\ntip_radius = '2 um'\n")
    path = table(tmp_path, b"\xef\xbb\xbf" + rows.encode())
    log = read_table(path)
    assert len(log.trace) == 20 and log.metadata["columns"] == {"x": "x", "z": "z"}


# --- long tables ------------------------------------------------------------------------------------------


def long_table(path: Path, rows: int = 5000) -> Path:
    x = 1e-3 * np.arange(rows)
    z = 0.05 * np.sin(40.0 * x) + 1e-3 * np.random.default_rng(0).normal(size=rows)
    path.write_text("# a long one\nx [mm];z [um]\n" + "\n".join(f"{a:.3f};{b:.5f}" for a, b in zip(x, z, strict=True)))
    return path


def test_the_pieces_of_a_table_are_the_table(tmp_path: Path) -> None:
    path = long_table(tmp_path / "long.csv")
    whole, pieces = read_text(path), list(read_pieces(path, size=3000))
    assert len(pieces) > 20
    assert np.array_equal(np.concatenate([piece.rows for piece in pieces]), whole.rows)
    assert {(piece.names, piece.units) for piece in pieces} == {(("x", "z"), ("mm", "um"))}
    lines = np.cumsum([0, *(len(piece.rows) for piece in pieces)])[:-1]
    assert [piece.first_line for piece in pieces] == (lines + whole.first_line).tolist()


def test_what_is_wrong_in_a_later_piece_names_its_line(tmp_path: Path) -> None:
    path = long_table(tmp_path / "long.csv")
    lines = path.read_text().split("\n")
    lines[3210] = "1.0;2.0;3.0"
    path.write_text("\n".join(lines))
    with pytest.raises(UserError, match=r"long\.csv: line 3211: expected 2 columns; found 3"):
        list(read_pieces(path, size=3000))


def test_a_long_table_is_inspected_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = long_table(tmp_path / "long.csv", 20_000)
    whole = inspect(path)
    monkeypatch.setattr(sys.modules["explore3d.log.inspect"], "READ_WHOLE", 1000)
    monkeypatch.setattr(read_pieces, "__defaults__", (None, 50_000))
    found = inspect(path)
    assert (found.samples, found.extent, found.metres) == (whole.samples, whole.extent, True)
    for one, other in zip(found.columns, whole.columns, strict=True):
        assert {key: one[key] for key in ("name", "unit", "least", "greatest", "missing")} == {
            key: other[key] for key in ("name", "unit", "least", "greatest", "missing")
        }
    assert found.columns[0]["is"] == "advances"
    assert found.spacing == pytest.approx(whole.spacing, rel=1e-3)
    assert any("looked at in pieces" in each for each in found.doubtful)


def test_a_table_that_memory_cannot_hold_is_refused_before_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = long_table(tmp_path / "long.csv")
    memory = importlib.import_module("explore3d.log.own.memory")
    monkeypatch.setattr(memory, "free_memory", lambda: 1e5)
    monkeypatch.setattr(Path, "read_bytes", lambda self: pytest.fail("it was read"))
    with pytest.raises(
        UserError, match=r"long\.csv: to read its .* takes about .* GB are free; possible: --average 50, "
    ):
        read_text(path)


@pytest.mark.parametrize("form", ["%.18e", "%.17g", "%.16e", "%r", "%.3f000000000000000"])
def test_long_numbers_are_read_as_python_reads_them(form: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    cells = [form % value for value in (rng.normal(size=4000) * 10.0 ** rng.uniform(-9, 5, 4000)).tolist()]
    lines = (f"{1e-3 * k:.18e},{cell}" for k, cell in enumerate(cells))
    read_as = read(tmp_path, "x [mm],z [mm]\n" + "\n".join(lines) + "\n").trace.centers[:, 2]
    assert np.array_equal(read_as, 1e-3 * np.array([float(cell) for cell in cells]))


def test_a_number_beside_the_middle_of_two_is_rounded_to_the_nearer() -> None:
    rng = np.random.default_rng(4)
    middle = (2 * int(rng.integers(2**52, 2**53)) + 1 for _ in range(2000))
    cells = [f"{round(Fraction(m, 2**50) * 10**17) + k}e-17" for m in middle for k in (-1, 0, 1)]
    data = np.frombuffer(("\n".join(cells) + "\n").encode(), dtype=np.uint8)
    rows, odd = np.empty((len(cells), 1)), np.empty((len(cells), 4), dtype=np.int64)
    places = np.empty((2, len(cells)), dtype=np.int32)
    spans, strange, marks = (np.zeros(shape, dtype=np.int64) for shape in ((0, 0, 2), (9, 4), (1, 4)))
    *_, full = read_cells(data, 0, 44, 46, 0, np.zeros(1, bool), rows, *places, spans, odd, strange, marks)
    known = np.isfinite(rows[:, 0])
    assert not full and known.mean() > 0.5
    assert np.array_equal(rows[known, 0], np.array([float(cell) for cell in cells])[known])
