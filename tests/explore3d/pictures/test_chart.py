"""Plots written as SVG show their data where the axes say, and every word once."""

import re
import struct
import zlib

import numpy as np
import pytest

from explore3d.pictures.chart import FONT_SIZE, Panel, pixels_png, sheet
from explore3d.pictures.corner import contour
from explore3d.pictures.profile import thinned

# The base line of a number lies so far below its tick, px: half of a digit's height
DOWN = 0.35 * 0.92 * FONT_SIZE


def ticks(svg: str) -> tuple[dict[float, float], dict[float, float]]:
    """Abscissae and ordinates of the numbers at the axes, px, by the value that they say."""
    found = re.findall(r'<text x="([-\d.]+)" y="([-\d.]+)"[^>]*text-anchor="(middle|end)"[^>]*>(−?[\d.]+)</text>', svg)
    value = {word: float(word.replace("−", "-")) for *_, word in found}
    return (
        {value[word]: float(x) for x, _, anchor, word in found if anchor == "middle"},
        {value[word]: float(y) - DOWN for _, y, anchor, word in found if anchor == "end"},
    )


@pytest.mark.parametrize("log", [False, True])
def test_a_point_is_drawn_where_the_ticks_say(log: bool) -> None:
    panel = Panel(log_y=log)
    panel.marks([-2.0, 3.0], [0.1, 20.0], "#000", "o")
    svg = panel.svg(0.0, 0.0, 400.0, 300.0)
    columns, rows = ticks(svg)
    assert len(columns) > 3 and len(rows) >= 3
    left, top = map(float, re.search(r'<svg x="([\d.]+)" y="([\d.]+)"', svg).groups())
    centres = [(float(x) + left, float(y) + top) for x, y in re.findall(r'cx="([\d.]+)" cy="([\d.]+)"', svg)]
    scaled = {(np.log10(value) if log else value): row for value, row in rows.items()}
    for (x, y), (column, row) in zip([(-2.0, 0.1), (3.0, 20.0)], centres, strict=True):
        assert np.polyval(np.polyfit(list(columns), list(columns.values()), 1), x) == pytest.approx(column, abs=0.3)
        place = np.log10(y) if log else y
        assert np.polyval(np.polyfit(list(scaled), list(scaled.values()), 1), place) == pytest.approx(row, abs=0.3)


def test_a_line_is_broken_where_nothing_is_known_and_reaches_the_edges_where_it_is_endless() -> None:
    panel = Panel(x_limits=(0.0, 4.0), y_limits=(0.0, 1.0))
    panel.line([0.0, 1.0, np.nan, 3.0, 4.0], [0.5] * 5, "#123456")
    panel.level(0.25, "#654321")
    svg = panel.svg(0.0, 0.0, 300.0, 200.0)
    (line,) = re.findall(r'd="([^"]+)"[^>]*#123456', svg)
    assert line.count("M") == 2 and line.count("L") == 2
    (level,) = re.findall(r'd="M([\d.]+) [\d.]+L([\d.]+) [^"]+"[^>]*#654321', svg)
    assert float(level[0]) == 0.0 and float(level[1]) == pytest.approx(
        float(re.search(r'width="([\d.]+)" height="[\d.]+" overflow="hidden"', svg)[1]), abs=0.1
    )


def test_a_name_stands_once_in_the_legend_and_markup_in_it_is_escaped() -> None:
    panels = [Panel(title="<b>"), Panel()]
    for panel in panels:
        panel.line([0, 1], [0, 1], "#000", name="trace & base")
    drawing = sheet(panels, 600.0, 200.0, 2, legend=True).decode()
    assert drawing.count("trace &amp; base") == 1 and "&lt;b&gt;" in drawing and "<b>" not in drawing


def test_pixels_become_the_png_that_holds_them() -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (7, 5, 3), dtype=np.uint8)
    png = pixels_png(pixels)
    assert png.startswith(b"\x89PNG") and struct.unpack(">II", png[16:24]) == (5, 7)
    length = struct.unpack(">I", png[33:37])[0]
    rows = np.frombuffer(zlib.decompress(png[41 : 41 + length]), dtype=np.uint8).reshape(7, 16)
    assert (rows[:, 0] == 2).all()  # each row holds the difference to the one above
    np.testing.assert_array_equal(np.cumsum(rows[:, 1:], axis=0, dtype=np.uint8).reshape(7, 5, 3), pixels)


def test_a_contour_of_a_cone_is_its_circle() -> None:
    x, y = np.linspace(-1.0, 1.0, 81), np.linspace(-1.2, 1.2, 97)
    across, along = contour(x, y, np.hypot(*np.meshgrid(x, y, indexing="ij")), 0.7)
    assert np.hypot(across, along) == pytest.approx(np.full(across.shape, 0.7), abs=1e-3)
    length = float(np.hypot(np.diff(across), np.diff(along)).sum())
    assert length == pytest.approx(2 * np.pi * 0.7, rel=2e-3)


def test_a_long_profile_keeps_its_spikes() -> None:
    x = np.linspace(0.0, 1.0, 100_000)
    y = np.zeros_like(x)
    y[[12_345, 77_777]] = 1.0, -1.0
    few_x, few_y = thinned(x, y, 500)
    assert len(few_x) == 1000 and few_y.max() == 1.0 and few_y.min() == -1.0
    assert few_x[few_y.argmax()] == pytest.approx(x[12_345], abs=2e-3)
