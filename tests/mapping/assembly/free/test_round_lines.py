"""Round lines: a ring that one turn of a helix ran along is a line, not a spot wider than the body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mapping import Feature, Interval, Support, Trace
from mapping.assembly import assemble
from mapping.assembly.free import uncrossed
from mapping.base import fit_base
from mapping.detection import detect
from mapping.detection.path import sound_sweeps

RADIUS, TIP, PITCH = 20e-3, 2e-3, 2e-3


def helix(place: float, height: float) -> Trace:
    """Six turns of a helix over a cylinder with a ring of a height and no width about it, m."""
    angle = np.arange(0.0, 12.0 * np.pi, 4e-3)
    z = PITCH * angle / (2 * np.pi)
    out = RADIUS + np.sqrt(np.maximum((TIP + height) ** 2 - (z - place) ** 2, TIP**2))
    out += 1e-6 * np.random.default_rng(5).standard_normal(len(angle))
    centers = np.column_stack([out * np.cos(angle), out * np.sin(angle), z])
    return Trace(2e-4 * np.arange(float(len(angle))), centers, np.zeros(len(angle)), TIP)


@pytest.mark.parametrize("turns", [pytest.param(2.5, marks=pytest.mark.slow), 3.2])
def test_a_ring_that_one_turn_of_a_helix_ran_along_is_a_ridge_at_least_as_high_as_it_was_felt(turns: float) -> None:
    trace = helix(turns * PITCH, 0.1e-3)
    base = fit_base(trace)
    laid = sound_sweeps(trace, base).trace
    found = [feature for feature in assemble(detect(laid, base), laid, base) if feature.evidence.snr > 20.0]
    assert {feature.kind for feature in found} == {"ridge"} and len(found) < 3
    for ridge in found:
        assert np.abs(ridge.axis[:, 2] - turns * PITCH).max() < np.sqrt(2 * TIP * 0.1e-3)
        assert ridge.height.censored and 0.05e-3 < ridge.height.low < 0.101e-3
        assert ridge.length.low > 2.5 * RADIUS
        assert ridge.details.misfit is not None and "none crosses it" in ridge.details.misfit


def ring(radius: float, place: float, height: float, kind: str = "ridge") -> Feature:
    """A line half round the cylinder, m."""
    angle = np.linspace(0.0, np.pi, 40)
    normals = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(40)])
    known, length = Interval(height, height, height), np.pi * radius
    return Feature(
        kind, radius * normals + [0.0, 0.0, place], normals, known, Interval(abs(height), 0.0, 2.0 * abs(height)),
        Interval(length, length, length), Support(100.0, 1), True, 0.0,
    )  # fmt: skip


def test_a_line_that_others_cross_is_told_by_these_and_not_once_more_by_the_sweep_that_ran_along_it() -> None:
    felt, crossed = ring(RADIUS, 0.0, 0.08e-3), ring(RADIUS, 0.4e-3, 0.1e-3)
    assert not uncrossed([felt], [crossed], TIP)
    pieces = [
        replace(crossed, axis=crossed.axis[own], normals=crossed.normals[own]) for own in (slice(15), slice(20, 40))
    ]
    assert not uncrossed([felt], pieces, TIP)


@pytest.mark.parametrize("other", [ring(RADIUS, 1.0e-3, 0.1e-3), ring(RADIUS, 0.0, -0.1e-3, "groove")])
def test_a_line_that_lies_beside_another_or_is_none_of_its_kind_stays(other: Feature) -> None:
    felt = ring(RADIUS, 0.0, 0.08e-3)
    assert uncrossed([felt], [other], TIP) == [felt]
    short = replace(felt, axis=felt.axis[:10], normals=felt.normals[:10])
    assert uncrossed([felt], [short], TIP) == [felt]
