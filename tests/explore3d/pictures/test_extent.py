"""Extents: a line in space is laid out along itself, and what lies beside it keeps its side."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from explore3d.pictures.extent import _beside, extent_picture
from mapping import Feature, Interval, Support
from mapping.feature import Details

TURN = np.linspace(0.0, np.pi, 61)


def half_circle(radius: float = 0.01) -> Feature:
    """Round the wall of a cylinder about z: its chord is 2/pi of its length, and lies inside of the body."""
    normals = np.column_stack([np.cos(TURN), np.sin(TURN), 0.0 * TURN])
    sizes = [Interval(each, each, each) for each in (5e-4, 1e-3, np.pi * radius)]
    details = Details(axis_sd=np.full(len(TURN), 1e-5))
    return Feature(
        "ridge", radius * normals, normals, *sizes, Support(9.0, 9), True, 1e-5, id="ridge-1", details=details
    )


def test_a_point_beside_a_line_in_space_keeps_its_place_along_it_and_its_side() -> None:
    feature = half_circle()
    # to the left of a way round z, seen from outside, is up; the last point lies 1 mm beyond the end
    true = feature.axis[[10, 30, 60]] + np.array([[0, 0, 2e-4], [0, 0, -1e-4], [0, -1e-3, 0]])
    s, left = _beside(feature, true)
    assert s == pytest.approx(np.array([np.pi / 6 * 0.01, np.pi / 2 * 0.01, np.pi * 0.01 + 1e-3]), rel=2e-3)
    assert left == pytest.approx(np.array([2e-4, -1e-4, 0.0]), abs=3e-5)


def test_the_picture_is_as_long_as_the_line_not_as_its_chord() -> None:
    picture = extent_picture([half_circle()], [None])
    assert picture is not None
    ticks = [float(each) for each in re.findall(r">(\d+)</text>", picture.decode())]
    assert max(ticks) == 30.0  # of 31.4 mm; the chord has 20


def test_the_title_of_a_picture_fits_it() -> None:
    feature = replace(half_circle(), length=Interval(123.456e-3, 123.4e-3, 123.5e-3, censored=True))
    picture = extent_picture([feature], [None])
    assert picture is not None
    svg = picture.decode()
    begin, size, title = re.findall(r'<text x="([\d.]+)" y="[\d.]+" font-size="([\d.]+)"[^>]*>(ridge-1: [^<]*)<', svg)[
        0
    ]
    assert title.startswith("ridge-1: at least 123 mm long")
    # a bold letter is 0.58 of the font's size wide on average (DejaVu Sans)
    assert float(begin) + 0.58 * float(size) * len(title) < float(re.findall(r'width="([\d.]+)"', svg)[0])
