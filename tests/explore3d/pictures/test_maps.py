"""Maps in colours: what is unsure is pale, without a jump."""

from __future__ import annotations

import numpy as np
import pytest

from explore3d.pictures.maps import Felt, Line, _contradicted, _read, coloured, faded
from mapping import Feature, Interval, Support


def test_a_sure_value_has_its_colour_and_an_unsure_one_none() -> None:
    shares = np.array([0.5, -0.5, 0.5, 0.5, 3.0, 0.0])
    sd = np.array([1e-6, 1e-6, np.nan, 1e6, 1e-6, 0.0])
    np.testing.assert_allclose(faded(shares, sd), [0.5, -0.5, 0.5, 0.0, 1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(faded(np.array([1.0]), np.array([1.0])), 0.6827, atol=1e-4)  # of a normal, within one sd


def test_no_level_of_certainty_makes_a_jump() -> None:
    sd = np.geomspace(0.01, 100.0, 2001)
    drawn = faded(np.full(2001, 0.8), sd)
    assert np.abs(np.diff(coloured(0.5 + 0.5 * drawn), axis=0)).max() < 0.01
    assert (np.diff(drawn) <= 0.0).all() and drawn[0] > 0.79 and drawn[-1] < 0.01


def test_what_is_twice_as_sure_is_never_paler() -> None:
    shares = np.linspace(-1.5, 1.5, 301)
    for sd in (0.03, 0.3, 3.0):
        assert (np.abs(faded(shares, np.full(301, sd))) >= np.abs(faded(shares, np.full(301, 2.0 * sd)))).all()
        assert (np.diff(faded(shares, np.full(301, sd))) >= 0.0).all()  # order stays order


TIP = 5e-3  # m
UP = np.array([0.0, 0.0, 1.0])


def wire_felt(apart: float) -> tuple[Felt, Feature]:
    """Rows `apart`, m, over a plate with a wire of 0.65 mm at 35 degrees to them: red on its crest, white elsewhere."""
    x, y = np.meshgrid(np.arange(-0.03, 0.03, 5e-4), np.arange(-0.02, 0.02, apart))
    way = np.array([np.cos(0.61), np.sin(0.61), 0.0])
    places = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    across = places @ np.cross(UP, way)
    crest = np.exp(-0.5 * (across / 6e-4) ** 2)
    values = np.column_stack([crest, -0.1 * crest, np.full((x.size, 2), 1e-3)])
    sweep = np.repeat(np.arange(x.shape[0]), x.shape[1])
    axis = np.linspace(-0.014, 0.014, 15)[:, None] * way
    sizes = [Interval(each, each, each) for each in (6.5e-4, 6.5e-4, 0.028)]
    wire = Feature("ridge", axis, np.tile(UP, (15, 1)), *sizes, Support(9.0, 9), True, 1e-5)
    return Felt(places, np.tile(UP, (x.size, 1)), sweep, values), wire


def test_a_line_is_read_along_its_axis_however_far_apart_the_sweeps_lie() -> None:
    felt, wire = wire_felt(3e-3)  # five times the wire's width
    line = Line.of(wire, felt, TIP)
    assert line is not None
    assert line.scale[0] == pytest.approx(3e-3 / np.sin(0.61), rel=0.2)
    crest = wire.axis[0] + np.linspace(0.15, 0.85, 60)[:, None] * (wire.axis[-1] - wire.axis[0])
    _, beside = line.zone(crest, np.tile(UP, (60, 1)))
    along, _ = _read(beside / line.scale, line.beside, line.values)
    as_it_comes, _ = _read(crest, felt.places, felt.values)
    assert along[:, 0].min() > 0.5
    assert as_it_comes[:, 0].min() < 0.2  # between the sweeps the crest would be lost: flecks


def test_a_line_that_two_sweeps_cross_is_not_read_between_them() -> None:
    felt, wire = wire_felt(3e-3)
    two = (np.abs(felt.places[:, 1]) < 2.5e-3) & np.isin(felt.sweep, [6, 7])
    few = Felt(felt.places[two], felt.normals[two], felt.sweep[two], felt.values[two])
    assert Line.of(wire, few, TIP) is None


def test_the_other_side_of_a_thin_wall_is_not_read() -> None:
    front, back = np.zeros((3, 3)), np.array([[0.0, 0.0, -1e-4]] * 3)
    places, normals = np.vstack([front, back]), np.vstack([np.tile(UP, (3, 1)), np.tile(-UP, (3, 1))])
    values = np.array([[1.0, 1.0, 0.0, 0.0]] * 3 + [[-1.0, -1.0, 0.0, 0.0]] * 3)
    read, apart = _read(np.array([[0.0, 0.0, -0.9e-4]]), places, values, (UP[None], normals))
    np.testing.assert_allclose(read[0, :2], 1.0)
    assert apart[0] == pytest.approx(0.9e-4)


def test_what_only_one_of_two_sweeps_says_is_unsure() -> None:
    faces = np.array([[0, 1, 2], [1, 3, 2]])  # 0 and 1 are one sweep, 2 and 3 the other
    values = np.array([[1.0, 0.0], [1.0, 0.0], [1.0, 0.0], [-1.0, 0.0]])
    found = _contradicted(faces, np.array([1, 1, 2, 2]), values)
    assert found[0] == pytest.approx([0.0, 0.0])
    assert found[3, 0] == pytest.approx(2.0)
    assert found[1, 0] == pytest.approx(np.sqrt(4.0 / 3.0))  # the side between both faces counts twice
    assert not _contradicted(faces, np.ones(4, dtype=int), values).any()
