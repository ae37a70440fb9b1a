"""The numbers that docs/theory.md states for the paper's wire, computed again by dense algebra, in millimetres."""

from __future__ import annotations

import numpy as np
import pytest

R, D, SIGMA, SPACING = 10.0, 0.65, 0.2, 0.006
X_C = np.sqrt(2 * R * D)


def wire(x: np.ndarray, diameter: float = D) -> np.ndarray:
    """Trace of a wire on a plane (theory equation 4.2)."""
    big = R + diameter / 2
    arc = diameter - x**2 / (big + np.sqrt(np.maximum((big - x) * (big + x), 0.0)))
    return np.where(np.abs(x) < np.sqrt(2 * R * diameter), arc, 0.0)


def sensitivities(x: np.ndarray) -> np.ndarray:
    """(N, 2) derivatives of the trace by place and diameter, by central differences."""
    step = 1e-5
    place = (wire(x - step) - wire(x + step)) / (2 * step)
    return np.column_stack([place, (wire(x, D + step) - wire(x, D - step)) / (2 * step)])


def covariance(x: np.ndarray, length: float) -> np.ndarray:
    return SIGMA**2 * np.exp(-np.abs(np.subtract.outer(x, x)) / length)


# 12 mm to either side of the crest; a spacing far below every correlation length asked about changes nothing
PLACES = np.arange(-12.0, 12.015, 0.03)


def test_in_white_noise_the_wire_stands_out_83_times_and_its_place_is_known_to_28_um() -> None:
    x = np.arange(-12.0, 12.0, SPACING)
    assert np.sqrt((wire(x) ** 2).sum()) / SIGMA == pytest.approx(83, abs=0.5)
    assert SIGMA / np.sqrt((sensitivities(x)[:, 0] ** 2).sum()) == pytest.approx(0.028, abs=5e-4)


@pytest.mark.parametrize(("length", "known", "free"), [(1.0, 4.9, 4.4), (2.27, 4.2, 4.0), (3.0, 4.3, 4.2)])
def test_in_correlated_noise_it_stands_out_four_to_five_times(length: float, known: float, free: float) -> None:
    weight = np.linalg.inv(covariance(PLACES, length))
    template, nuisance = wire(PLACES), np.column_stack([np.ones_like(PLACES), PLACES])
    exact = template @ weight @ template
    assert np.sqrt(exact) == pytest.approx(known, abs=0.06)
    shared = nuisance.T @ weight @ template
    assert np.sqrt(exact - shared @ np.linalg.solve(nuisance.T @ weight @ nuisance, shared)) == pytest.approx(
        free, abs=0.06
    )


@pytest.mark.parametrize(("length", "place", "height"), [(0.1, 5.7, 5.8), (0.5, 11.5, 12.4), (3.0, 15.4, 24.9)])
def test_a_white_likelihood_claims_intervals_so_many_times_too_narrow(
    length: float, place: float, height: float
) -> None:
    j = sensitivities(PLACES)
    inverse = np.linalg.inv(j.T @ j)
    claimed = SIGMA**2 * inverse * SPACING / (PLACES[1] - PLACES[0])
    true = inverse @ j.T @ covariance(PLACES, length) @ j @ inverse
    assert np.sqrt(np.diag(true) / np.diag(claimed)) == pytest.approx([place, height], abs=0.3)


def test_bins_of_a_thirtieth_of_the_half_width_cost_what_equation_8_1_says() -> None:
    fine, count = 5e-4, round(X_C / 30 / 5e-4)
    lost = []
    for begin in range(0, count, count // 24):
        x = np.arange(-6.0, 6.0, fine)[begin:]
        j = sensitivities(x[: len(x) // count * count])
        binned = j.reshape(-1, count, 2).mean(axis=1)
        lost.append(1 - count * (binned**2).sum(axis=0) / (j**2).sum(axis=0))
    assert np.mean(lost, axis=0) == pytest.approx([1 / 60, 1 / 180], abs=1e-3)


def test_the_smallest_wire_found_with_95_percent_is_81_um_thick() -> None:
    def surplus(diameter: float) -> float:
        """By how much the expected output passes threshold plus 1.645 (theory equations 6.9, 6.12 and 6.13)."""
        half_width = np.sqrt(2 * R * diameter)
        rate = np.sqrt(2.5) / (2 * np.pi * half_width)
        output = diameter / SIGMA * np.sqrt(16 * half_width / (15 * SPACING))
        return float(output - np.sqrt(2 * np.log(rate * 100 / 1e-3)) - 1.645)

    assert surplus(0.0805) < 0 < surplus(0.0815)
