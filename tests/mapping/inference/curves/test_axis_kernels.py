"""The compiled axes against the chart's and the modes' own words."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.inference.curves.axis_kernels import axes_about
from mapping.inference.curves.chart import Chart
from mapping.inference.curves.curve_modes import CurveModes


def bent_chart(closed: bool) -> Chart:
    angle = np.linspace(0.0, 2.0 * np.pi if closed else 2.0, 25)
    zero = np.zeros_like(angle)
    points = 0.02 * np.column_stack([np.cos(angle), np.sin(angle), zero])
    tangents = np.column_stack([-np.sin(angle), np.cos(angle), zero])
    normals = np.tile([0.0, 0.0, 1.0], (len(angle), 1))
    bend = 20.0 + 5.0 * np.sin(angle)
    return Chart(0.02 * angle, points, tangents, np.cross(normals, tangents), normals, bend, zero, closed)


def lifted(at, aside, lift):
    points, laterals, normals, bend = at
    over, up = aside * (1.0 + lift * bend), lift - 0.5 * bend * aside**2
    return points + over[..., None] * laterals + up[..., None] * normals


@pytest.mark.parametrize("degree", [0, 1, 2, 5, 8])
def test_axes_between_their_ends_are_those_of_the_modes(degree: int) -> None:
    rng = np.random.default_rng(degree)
    chart, modes = bent_chart(False), CurveModes(degree, 0.021, 0.012, False)
    coefficients = 1e-3 * rng.standard_normal((30, modes.count)) * modes.scale / modes.scale.max()
    ends = np.sort(rng.uniform(chart.s[0], chart.s[-1], (30, 2)), axis=1)
    lift = 1e-4 * rng.random(30)
    frames = (chart.points, chart.laterals, chart.normals, chart.bend)
    found = axes_about(chart.s, *frames, modes.basis(chart.s), modes.middle, modes.reach, coefficients, lift, ends)
    for axis, own, up, (start, end) in zip(found, coefficients, lift, ends, strict=True):
        s = np.clip(chart.s, start, end)
        expected = lifted(chart.at(s), modes.lateral(own[None], s)[0], np.array(up))
        assert axis == pytest.approx(expected, abs=1e-15)


def test_a_closed_axis_has_no_ends() -> None:
    chart, modes = bent_chart(True), CurveModes(2, 0.0628, 0.0628, True)
    coefficients = 1e-3 * np.random.default_rng(1).standard_normal((4, modes.count))
    frames = (chart.points, chart.laterals, chart.normals, chart.bend)
    found = axes_about(
        chart.s, *frames, modes.basis(chart.s), modes.middle, modes.reach, coefficients, np.zeros(4), np.zeros((0, 2))
    )
    expected = [lifted(chart.at(chart.s), lateral, np.zeros(1)) for lateral in modes.lateral(coefficients, chart.s)]
    assert found == pytest.approx(np.array(expected), abs=1e-15)
