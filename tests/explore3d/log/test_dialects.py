"""Dialects of tables: one known profile, one known cloud, as instruments, programs and offices write them.

Each dialect is read as what it is, or refused in one line; none is read as something else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from explore3d import UserError
from explore3d.log.table import read_table

N = 40
RNG = np.random.default_rng(17)
X = 8.6722 + 0.0525 * np.arange(N)  # mm
Z = np.round(0.4 + 0.05 * np.sin(X) + 0.02 * RNG.normal(size=N), 6)  # mm
PROFILE = np.column_stack([X, Z])
ALONG, LINES = np.round(0.25 + 0.5 * np.arange(16), 4), np.round(3.1 + 4.0 * np.arange(5), 4)
CLOUD = np.column_stack([np.tile(ALONG, 5), np.repeat(LINES, 16), np.round(0.3 + 0.01 * RNG.normal(size=80), 6)])
LINE = np.repeat(np.arange(5), 16)
FRO = np.concatenate([np.arange(16)[:: 1 if k % 2 == 0 else -1] + 16 * k for k in range(5)])  # to and fro
MM = {"units": "mm"}

Dialect = tuple[str, str | bytes, dict[str, Any], np.ndarray]
DIALECTS: list[Dialect] = []
PLAIN = "{:.6f}".format


def lines(
    table: Sequence[Sequence[object]], sep: str = ";", form: Callable[[float], str] = PLAIN, comma: bool = False
) -> str:
    """Rows as text; strings stay as they are."""
    rows = []
    for row in table:
        cells = [value if isinstance(value, str) else form(float(value)) for value in row]  # type: ignore[arg-type]
        rows.append(sep.join(cell.replace(".", ",") if comma else cell for cell in cells))
    return "\n".join(rows) + "\n"


def add(name: str, content: str | bytes, options: dict[str, Any] | None = None, truth: np.ndarray = PROFILE) -> None:
    DIALECTS.append((name, content, options or {}, truth))


def both(*columns: object) -> list[list[object]]:
    """Rows from columns that are arrays or lists."""
    return [list(row) for row in zip(*[list(column) for column in columns], strict=True)]  # type: ignore[call-overload]


def every_dialect() -> None:
    head = "X;Z\n"
    body = lines(PROFILE)
    # delimiters and decimal signs, with and without a header, profile and cloud
    for name, sep in {"semicolon": ";", "comma": ",", "tab": "\t", "blank": " ", "blanks": "   ", "bar": "|"}.items():
        add(f"{name}, header", f"x{sep}z\n" + lines(PROFILE, sep), MM)
        add(f"{name}, no header", lines(PROFILE, sep), MM)
        add(f"{name}, cloud", f"x{sep}y{sep}z\n" + lines(CLOUD, sep), MM, CLOUD)
        add(f"{name}, cloud, no header", lines(CLOUD, sep), MM, CLOUD)
        if sep != ",":
            add(f"{name}, decimal comma", f"x{sep}z\n" + lines(PROFILE, sep, comma=True), MM)
    add("comma and blank", "x, z\n" + lines(PROFILE, ", "), MM)
    add(
        "quoted decimal comma",
        '"x","z"\n'
        + "".join(
            f'"{a:.6f}","{b:.6f}"\n'.replace(".", ",").replace('","', '"§"').replace(",", ",").replace("§", ",")
            for a, b in PROFILE
        ),
        MM,
    )
    add("all quoted", '"x";"z"\n' + "".join(f'"{a:.6f}";"{b:.6f}"\n' for a, b in PROFILE), MM)
    add("decimal comma without quotes", "x,z\n" + lines(PROFILE, ",", comma=True), MM)
    add("delimiter at the end", "x;z;\n" + "".join(f"{a:.6f};{b:.6f};\n" for a, b in PROFILE), MM)
    add("comma at the end", "x,z,\n" + "".join(f"{a:.6f},{b:.6f},\n" for a, b in PROFILE), MM)
    add("columns aligned", "       x           z\n" + "".join(f"{a:12.6f}{b:12.6f}\n" for a, b in PROFILE), MM)
    add("exponents", head + lines(PROFILE, form="{:.9e}".format), MM)
    add("exponents with decimal comma", head + lines(PROFILE, form="{:.9E}".format, comma=True), MM)
    add("plus signs", head + lines(PROFILE, form="{:+.6f}".format), MM)
    add("17 digits", head + lines(PROFILE, form=repr), MM)
    # line ends and encodings
    add("CR LF", (head + body).replace("\n", "\r\n"), MM)
    add("CR", (head + body).replace("\n", "\r"), MM)
    for code in ("utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "latin-1", "cp1252"):
        add(f"encoding {code}", ("x [µm];z [µm]\n" + lines(1e3 * PROFILE)).encode(code))
    add("Greek mu", "x [μm];z [μm]\n" + lines(1e3 * PROFILE))
    add("minus of typographers", head + lines(PROFILE * [1, -1]).replace("-", "\u2212"), MM, PROFILE * [1, -1])
    # units in headers
    for unit, size in {
        "um": 1e-3, "micron": 1e-3, "microns": 1e-3, "micrometer": 1e-3, "micrometre": 1e-3, "Micrometers": 1e-3,
        "MM": 1.0, "millimeter": 1.0, "nm": 1e-6, "nanometers": 1e-6, "A": 1e-7, "Å": 1e-7, "Angstrom": 1e-7,
        "mil": 0.0254, "thou": 0.0254, "inch": 25.4, "in": 25.4, "m": 1e3, "cm": 10.0, "1e-6 m": 1e-3,
    }.items():  # fmt: skip
        add(f"unit [{unit}]", f"x [{unit}];z [{unit}]\n" + lines(PROFILE / size, form=repr))
    table = lines(PROFILE * [1, 1e3])
    for name, header in {
        "brackets": "X [mm];Z [um]", "parentheses": "X (mm);Z (um)", "slash": "X/mm;Z/um", "braces": "X {mm};Z {um}",
        "underscore": "x_mm;z_um", "in": "x in mm;z in um", "blank": "x mm;z um", "angle": "x <mm>;z <um>",
        "row of units": "x;z\nmm;um", "row of units in brackets": "x;z\n[mm];[um]", "comma": '"x, mm";"z, um"',
        "comment": "# x [mm]; z [um]", "long": "Position [mm];Height [um]", "axis": "X axis (mm);Z axis (µm)",
        "profile": "Lateral Position [mm];Total Profile [microns]", "German": "Weg [mm];Höhe [µm]",
        "units of axes": "X unit: mm\nZ unit: um\nx;z", "colon": "x:mm;z:um",
    }.items():  # fmt: skip
        add(f"units: {name}", f"{header}\n{table}")
    add("units in a comment", "# units: mm\nx;z\n" + body)
    add("units in words", "# all coordinates in micrometers\nx;z\n" + lines(1e3 * PROFILE))
    add("unit for all", "Unit;um\nx;z\n" + lines(1e3 * PROFILE))
    add("units in the cells", head + "".join(f"{a:.6f} mm;{1e3 * b:.3f} um\n" for a, b in PROFILE))
    add("a unit that is none", "x [mm];z [V]\n" + body)
    add("units in millivolts, given mm", "x [mm];z [mV]\n" + body, MM)
    add("units contradicted", "x [um];z [um]\n" + lines(1e3 * PROFILE), MM)
    add("no unit anywhere", head + body)
    add("a scale factor", "z scale factor: 0.001\nx [mm];z [mm]\n" + lines(PROFILE * [1, 1e3]))
    # names
    add("height before position", "Height [mm];Position [mm]\n" + lines(PROFILE[:, ::-1]))
    add("z before x", "z;x\n" + lines(PROFILE[:, ::-1]), MM)
    add("second column advances, no header", lines(PROFILE[:, ::-1]), MM)
    add("height called y", "X;Y\n" + body, MM)
    add("along y", "y;z\n" + body, MM)
    add("names that nobody knows", "foo;bar\n" + body, MM)
    add("names that nobody knows, said", "foo;bar\n" + body, MM | {"columns": "x=foo, z=bar"})
    add("two pairs", "x;z;x;z\n" + lines(np.hstack([PROFILE, PROFILE + 1])), MM)
    add("depth", "x;depth\n" + lines(PROFILE * [1, -1]), MM)
    add("header of other delimiter", "x, z\n" + lines(PROFILE, " "), MM)
    add("header with fewer names than columns", "x;z\n" + lines(np.column_stack([PROFILE, 0.3 * Z])), MM)
    add(
        "normals and forces",
        "x,y,z,nx,ny,nz\n" + lines(np.hstack([CLOUD, np.tile([0, 0, 1.0], (80, 1))]), ","),
        MM,
        CLOUD,
    )
    # index columns
    whole = [str(k) for k in range(N)]
    add("pandas index", ",x,z\n" + lines(both(whole, X, Z), ","), MM)
    add("R row names", '"x" "z"\n' + lines(both([f'"{k + 1}"' for k in range(N)], X, Z), " "), MM)
    add("index named", "n;x;z\n" + lines(both(whole, X, Z)), MM)
    add("Index named, of a cloud", "Index,X,Y,Z\n" + lines(both(map(str, range(1, 81)), *CLOUD.T), ","), MM, CLOUD)
    add("index, no header", lines(both(whole, X, Z)), MM)
    add("index and height alone", "index;z\n" + lines(both(whole, Z)), MM)
    add("index and height alone, no header", lines(both(whole, Z)), MM)
    add("index of a cloud, no header", lines(both(map(str, range(80)), *CLOUD.T)), MM, CLOUD)
    add("numbers as names", "0,1\n" + lines(PROFILE, ","), MM)
    add("numbers as names, and an index", ",0,1\n" + lines(both(whole, X, Z), ","), MM)
    # text, marks, times
    add("a column of text", "x;z;remark\n" + lines(both(X, Z, ["good"] * N)), MM)
    add("text first", "tool;x;z\n" + lines(both(["A7"] * N, X, Z)), MM)
    add("a mark", "x;z;valid\n" + lines(both(X, Z, ["1"] * N)), MM)
    add("a mark in words", "x;z;valid\n" + lines(both(X, Z, ["true"] * N)), MM)
    add("a mark, no header", lines(both(X, Z, ["0"] + ["1"] * (N - 1))), MM)
    add("labels of lines", "x,y,z,line\n" + lines(both(*CLOUD.T, [f"L{k}" for k in LINE]), ","), MM, CLOUD)
    start = datetime(2026, 3, 1, 12, 0)
    iso = [(start + timedelta(seconds=0.1 * k)).isoformat() for k in range(N)]
    add("ISO times", "time;x;z\n" + lines(both(iso, X, Z)), MM)
    add("ISO times with a blank", "Timestamp,x,z\n" + lines(both([t.replace("T", " ") for t in iso], X, Z), ","), MM)
    add("clock times", "time;x;z\n" + lines(both([t[11:] for t in iso], X, Z)), MM)
    add("seconds", "t;x;z\n" + lines(both(0.1 * np.arange(N), X, Z)), MM)
    add("seconds, no header", lines(both(0.1 * np.arange(N), X, Z)), MM)
    add(
        "nanoseconds since 1970",
        "timestamp,x,z\n" + lines(both([str(10**18 * 17 // 10 + 10**8 * k) for k in range(N)], X, Z), ","),
        MM,
    )
    add("standard deviations, no header", lines(both(X, Z, np.full(N, 0.01) + 0.001 * RNG.random(N))), MM)
    # preambles and footers
    preamble = "Instrument: X9\nOperator;Smith\nDate;2020-01-15\nPoints;40\nSpeed;0.5\n"
    add("preamble", preamble + "\nx;z\n" + body, MM)
    add("numbers above the header", "2020;15\n40;2\nx;z\n" + body, MM)
    add("numbers and words above the header", "Points;40\n0.5;2.0\n[mm];[mm]\nx;z\n" + body, MM)
    add("a count first", "40 2\n" + lines(PROFILE, " "), MM)
    add("a count alone first", "40\n" + lines(PROFILE, " "), MM)
    add("sections", "[Header]\nVersion=3\n[Data]\nx;z\n" + body, MM)
    add("footer in words", head + body + "End of data\n", MM)
    add("footer of figures", head + body + "Mean;0.4\nSd;0.02\n", MM)
    add("footer of one figure", head + body + "\nRa = 0.0123 um\nRq = 0.0234 um\n", MM)
    add("repeated headers", head + lines(PROFILE[:20]) + head + lines(PROFILE[20:]), MM)
    add("comments between", head + lines(PROFILE[:20]) + "# a break\n" + lines(PROFILE[20:]), MM)
    add("comments behind", head + "".join(f"{a:.6f};{b:.6f} # point\n" for a, b in PROFILE), MM)
    add("comments behind, blanks", "".join(f"{a:.6f} {b:.6f} // point\n" for a, b in PROFILE), MM)
    add("percent comments", "% x z\n" + lines(PROFILE, " "), MM)
    add("blank lines between", head + body.replace("\n", "\n\n"), MM)
    add("last line cut", head + body + "10.7", MM)
    # thousands
    big = np.column_stack([np.round(1e3 * X, 1), np.round(1e3 * Z + 1000, 1)])
    add(
        "thousands by comma, quoted",
        '"x [um]","z [um]"\n' + "".join(f'"{a:,.1f}","{b:,.1f}"\n' for a, b in big),
        {},
        big / 1e3,
    )
    add("thousands by comma", "x [um];z [um]\n" + lines(big, form="{:,.1f}".format), {}, big / 1e3)
    german = lines(big, form=lambda v: f"{v:,.1f}".replace(",", "_").replace(".", ",").replace("_", "."))
    add("thousands by point", "x [um];z [um]\n" + german, {}, big / 1e3)
    add(
        "thousands by apostrophe",
        "x [um];z [um]\n" + lines(big, form=lambda v: f"{v:,.1f}".replace(",", "'")),
        {},
        big / 1e3,
    )
    add(
        "thousands by narrow blank",
        "x [um];z [um]\n" + lines(big, form=lambda v: f"{v:,.1f}".replace(",", "\u202f")),
        {},
        big / 1e3,
    )
    add(
        "thousands by blank",
        "x [um];z [um]\n" + lines(big, form=lambda v: f"{v:,.1f}".replace(",", " ")),
        {},
        big / 1e3,
    )
    round_ = np.round(np.column_stack([np.linspace(900, 4000, N), 1200 + 1e3 * Z]))
    add("whole thousands by comma", "x [nm];z [nm]\n" + lines(round_, form="{:,.0f}".format), {}, round_ / 1e6)
    add(
        "whole thousands by point",
        "x [nm];z [nm]\n" + lines(round_, form=lambda v: f"{v:,.0f}".replace(",", ".")),
        {},
        round_ / 1e6,
    )
    add(
        "three digits after the comma",
        "x;z\n" + lines(np.round(PROFILE + 1, 3), form="{:.3f}".format, comma=True),
        MM,
        np.round(PROFILE + 1, 3),
    )
    add(
        "three digits after the comma, said",
        "x;z\n" + lines(np.round(PROFILE + 1, 3), form="{:.3f}".format, comma=True),
        MM | {"decimal": ","},
        np.round(PROFILE + 1, 3),
    )
    add(
        "three digits after the comma, some below 1",
        "x;z\n" + lines(np.round(PROFILE, 3), form="{:.3f}".format, comma=True),
        MM,
        np.round(PROFILE, 3),
    )
    add(
        "three digits after the point",
        "x;z\n" + lines(np.round(PROFILE, 3), form="{:.3f}".format),
        MM,
        np.round(PROFILE, 3),
    )
    # missing values and sentinels: rows 7 and 20 to 22 hold none
    gone = [7, 20, 21, 22]
    rest = np.delete(PROFILE, gone, axis=0)
    for word in ("", "NaN", "nan", "NULL", "N/A", "***", "1.#QNAN", "-1.#IND", "inf", "-9999", "-9999.0", "9999",
                 "1e30", "-999", "1e+31", "3.4028235e38", "-32768", "BAD", "---", "#N/A", "?"):  # fmt: skip
        add(
            f"no height: {word!r}",
            head + lines([[a, word if k in gone else b] for k, (a, b) in enumerate(PROFILE)]),
            MM,
            rest,
        )
    add(
        "heights at the end of the range",
        head + lines([[a, 51.2 if k in gone else b] for k, (a, b) in enumerate(PROFILE)]),
        MM,
        rest,
    )
    add("zeros at the end", head + body + "0.000000;0.000000\n" * 5, MM)
    add(
        "an unknown word for a height",
        head + lines([[a, "six" if k == 7 else b] for k, (a, b) in enumerate(PROFILE)]),
        MM,
        rest,
    )
    # order
    mixed = RNG.permutation(N)
    add("rows in no order", head + lines(PROFILE[mixed]), MM)
    add("rows in order of text", head + "\n".join(sorted(body.split())) + "\n", MM)
    add("rows in no order, with times", "t;x;z\n" + lines(np.column_stack([0.1 * np.arange(N), PROFILE])[mixed]), MM)
    add("backwards", head + lines(PROFILE[::-1]), MM, PROFILE[::-1])
    add("a cloud to and fro", "x,y,z\n" + lines(CLOUD[FRO], ","), MM, CLOUD[FRO])
    add("a cloud in no order", "x,y,z\n" + lines(CLOUD[RNG.permutation(80)], ","), MM, CLOUD)
    add("gnuplot's blocks", "# x y z\n" + "\n".join(lines(CLOUD[k == LINE], " ") for k in range(5)), MM, CLOUD)
    add("there and back", head + lines(np.vstack([PROFILE, PROFILE[::-1]])), MM, np.vstack([PROFILE, PROFILE[::-1]]))
    add("one column", "\n".join(PLAIN(z) for z in Z) + "\n", MM)
    add("one column with decimal comma", "\n".join(f"{z + k / 30:.3f}".replace(".", ",") for k, z in enumerate(Z)), MM)
    add("a matrix of heights", lines(Z.reshape(5, 8)), MM)
    add("JSON", '[{"x": 1.0, "z": 2.0}, {"x": 2.0, "z": 2.5}]', MM)


every_dialect()


def outcome(folder: Path, dialect: Dialect) -> str:
    """ "right", "refused", or what is wrong."""
    _, content, options, truth = dialect
    path = folder / "scan.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    try:
        trace = read_table(path, tip_radius="2 um", **options).trace
    except UserError as error:
        message = str(error)
        return "refused" if message.startswith(f"{path}: ") and "\n" not in message else f"unclear: {message}"
    want = 1e-3 * (truth if truth.shape[1] == 3 else np.insert(truth, 1, 0.0, axis=1))
    if trace.centers.shape != want.shape:
        return f"wrong: {len(trace)} points instead of {len(want)}"
    # what is written with three digits of a micrometre cannot come back better than half of the last
    if not np.allclose(trace.centers, want, rtol=1e-9, atol=0.6e-9):
        return f"wrong: {trace.centers[:2].tolist()} instead of {want[:2].tolist()}"
    sweeps = 5 if len(truth) == 80 and truth.shape[1] == 3 else 2 if len(truth) == 2 * N else 1
    found = len(np.unique(trace.sweep))
    return "right" if found == sweeps else f"wrong: {found} sweeps instead of {sweeps}"


REFUSED = {
    "decimal comma without quotes", "a unit that is none", "units in millivolts, given mm", "units contradicted",
    "no unit anywhere", "a scale factor", "second column advances, no header", "names that nobody knows", "two pairs",
    "depth", "header with fewer names than columns", "index and height alone", "index and height alone, no header",
    "a mark, no header", "seconds, no header", "standard deviations, no header", "whole thousands by comma",
    "whole thousands by point", "three digits after the comma", "an unknown word for a height", "a cloud in no order",
    "units in the cells", "one column", "one column with decimal comma", "a matrix of heights", "JSON",
}  # fmt: skip


def test_there_are_at_least_120_dialects_and_100_are_read() -> None:
    names = {name for name, *_ in DIALECTS}
    assert len(names) == len(DIALECTS) >= 120 and names >= REFUSED
    assert len(names - REFUSED) >= 100


@pytest.mark.parametrize("dialect", DIALECTS, ids=[name for name, *_ in DIALECTS])
def test_a_dialect_is_read_right_or_refused_in_one_line(tmp_path: Path, dialect: Dialect) -> None:
    assert outcome(tmp_path, dialect) == ("refused" if dialect[0] in REFUSED else "right")
