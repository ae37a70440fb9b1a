"""Roughness by the standards: the filter's transmission, parameters of sines and noise in closed form, intervals."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from gwyddion import gwyddion, spacing_of_peaks

from mapping.estimate.roughness.areal import areal_parameters
from mapping.estimate.roughness.filters import gaussian_mean, suited_cutoff
from mapping.estimate.roughness.profile import Stretch, profile_parameters

STEP, CUTOFF = 0.5e-6, 0.25e-3
STYLUS = Path(__file__).parents[5] / "shared" / "data" / "stylus_profile_mm.csv"


def stretch(heights: np.ndarray, keep: np.ndarray | None = None) -> Stretch:
    return Stretch(heights, np.ones(len(heights), dtype=bool) if keep is None else keep, STEP)


@pytest.mark.parametrize("wavelength", [0.5, 1.0, 2.0, 5.0])
def test_the_filter_passes_of_a_wave_what_the_standard_says(wavelength: float) -> None:
    """exp(-pi (alpha L / wavelength)^2), that is 2^-(L / wavelength)^2: ISO 16610-21, formula 4."""
    x = STEP * np.arange(8000)
    wave = np.cos(2.0 * np.pi * (x - x[4000]) / (wavelength * CUTOFF))
    assert gaussian_mean(wave, STEP, CUTOFF)[4000] == pytest.approx(2.0 ** -(wavelength**-2.0), abs=2e-5)


def test_a_mean_surface_passes_the_same_along_each_axis() -> None:
    x = 5e-6 * np.arange(301)
    wave = np.cos(2.0 * np.pi * (x - x[150]) / CUTOFF)
    for heights, spacing in ((np.tile(wave, (201, 1)), (10e-6, 5e-6)), (np.tile(wave, (201, 1)).T, (5e-6, 10e-6))):
        middle = tuple(size // 2 for size in heights.shape)
        assert gaussian_mean(heights, spacing, CUTOFF)[middle] == pytest.approx(0.5, abs=1e-3)


def test_what_is_left_out_does_not_pull_the_mean_line() -> None:
    heights = 1e-6 + np.zeros(4000)
    heights[1900:2100] = 1.0
    keep = heights < 0.5
    assert np.nanmax(np.abs(gaussian_mean(heights, STEP, CUTOFF, keep) - 1e-6)) < 1e-15


def test_a_sine_has_the_parameters_of_the_textbook() -> None:
    """Ra = 2 A / pi, Rq = A / sqrt 2, Rz = 2 A, Rsk = 0, Rku = 3/2, Rsm = wavelength; the filter takes 2^-25 of it."""
    amplitude, wavelength = 1e-6, CUTOFF / 5.0
    heights = amplitude * np.sin(2.0 * np.pi * STEP * np.arange(6 * 500) / wavelength + 0.3)
    values, sections = profile_parameters([stretch(heights)], CUTOFF)
    assert sections == 5
    expected = {"Ra": 2e-6 / math.pi, "Rq": 1e-6 / math.sqrt(2.0), "Rz": 2e-6, "Rku": 1.5, "Rsm": wavelength}
    for name, value in expected.items():
        assert values[name].median == pytest.approx(value, rel=2e-3), name
    assert abs(values["Rsk"].median) < 1e-3 and values["Wa"].median < 1e-3 * amplitude


def test_waviness_is_what_the_long_filter_passes() -> None:
    """A wave of four cut-offs: 2^-(1/16) of it is waviness, mean absolute 2 / pi of that."""
    heights = 1e-6 * np.sin(2.0 * np.pi * STEP * np.arange(500 * 13) / (4.0 * CUTOFF))
    values, _ = profile_parameters([stretch(heights)], CUTOFF)
    assert values["Wa"].median == pytest.approx(2e-6 / math.pi * 2.0 ** (-1.0 / 16.0), rel=0.01)


def test_features_that_are_left_out_change_nothing_but_the_interval() -> None:
    rng = np.random.default_rng(0)
    heights = 1e-7 * rng.standard_normal(20_000)
    bumped, keep = heights.copy(), np.ones(len(heights), dtype=bool)
    for first in (3000, 9000, 15_000):
        bumped[first : first + 150] += 1e-5
        keep[first : first + 150] = False
    alone, beside = (profile_parameters([stretch(z, keep)], CUTOFF)[0] for z in (heights, bumped))
    assert all(alone[name] == beside[name] for name in alone)
    assert alone["Rq"].median == pytest.approx(1e-7, rel=0.02)
    assert profile_parameters([stretch(bumped)], CUTOFF)[0]["Rq"].median > 5e-7


def test_intervals_cover_as_often_as_they_say() -> None:
    """White noise through an S-filter: 90 % intervals of Rq from five sections cover its mean over many profiles."""
    rng, found = np.random.default_rng(1), []
    for _ in range(120):
        heights = 1e-7 * rng.standard_normal(6 * 500)
        found.append(profile_parameters([stretch(heights)], CUTOFF, 20e-6)[0]["Rq"])
    true = math.sqrt(np.mean([each.median**2 for each in found]))
    covered = np.mean([each.low < true < each.high for each in found])
    assert 0.82 < covered < 0.96, covered


def test_spacing_is_that_of_the_whole_profile_where_few_elements_fit_a_section() -> None:
    """Waves of 0.2 and 0.6 cut-offs in turn: their mean is 0.4, but of a section's whole elements most are short."""
    lengths = np.tile([0.2, 0.6], 20) * CUTOFF
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    x = STEP * np.arange(int(ends[-1] / STEP))
    wave = np.searchsorted(ends, x, side="right") - 1
    heights = 1e-6 * lengths[wave] / CUTOFF * np.sin(2.0 * np.pi * (x - ends[wave]) / lengths[wave])
    values, sections = profile_parameters([stretch(heights)], CUTOFF)
    assert sections == 15 and values["Rsm"].median == pytest.approx(0.4 * CUTOFF, rel=0.02)


def test_an_element_that_a_feature_interrupts_does_not_count() -> None:
    wavelength = CUTOFF / 5.0
    heights = 1e-6 * np.sin(2.0 * np.pi * STEP * np.arange(11 * 500) / wavelength)
    keep = np.ones(len(heights), dtype=bool)
    keep[2000:2170] = False
    assert profile_parameters([stretch(heights, keep)], CUTOFF)[0]["Rsm"].median == pytest.approx(wavelength, rel=0.01)


def test_no_size_may_be_negative_where_one_section_holds_most_of_the_height() -> None:
    """A groove, wide but no feature, in one of eight sections of fine noise."""
    heights = 1e-8 * np.random.default_rng(4).standard_normal(9 * 500)
    heights[2100:2300] -= 2e-6
    values, sections = profile_parameters([stretch(heights)], CUTOFF)
    assert sections == 8
    for name in ("Ra", "Rq", "Rz", "Rku", "Wa"):
        assert 0.0 < values[name].low < values[name].median < values[name].high, name
    assert values["Ra"].low < 0.1 * values["Ra"].median  # most sections have less than that


def test_a_raster_has_the_parameters_of_its_profiles() -> None:
    rng = np.random.default_rng(2)
    heights = 1e-7 * rng.standard_normal((120, 400))
    values, squares = areal_parameters(heights, np.ones(heights.shape, dtype=bool), (10e-6, 5e-6), CUTOFF)
    assert squares == 3 * 7
    assert values["Sq"].median == pytest.approx(1e-7, rel=0.02) and values["Sku"].median == pytest.approx(3.0, rel=0.05)
    assert values["Sa"].low < 1e-7 * math.sqrt(2.0 / math.pi) < values["Sa"].high


def test_what_is_too_short_has_no_parameters() -> None:
    assert profile_parameters([stretch(np.zeros(900))], CUTOFF) == ({}, 0)
    assert suited_cutoff(4.8e-3, 5) == 0.8e-3 and suited_cutoff(0.4e-3, 5) is None


def test_the_root_mean_square_is_that_of_surface_topography() -> None:
    topography = pytest.importorskip("SurfaceTopography")
    rng = np.random.default_rng(3)
    heights = 1e-7 * np.convolve(rng.standard_normal(6 * 500 + 40), np.hanning(41) / 5.0, "valid")
    rough = heights - gaussian_mean(heights, STEP, CUTOFF)
    part = rough[250:2750]
    line = topography.UniformLineScan(part - part.mean(), STEP * len(part))
    values, _ = profile_parameters([stretch(heights)], CUTOFF)
    assert values["Rq"].median == pytest.approx(math.hypot(line.rms_height_from_profile(), part.mean()), rel=1e-6)


@pytest.mark.parametrize("cutoff", [0.25e-3, 0.8e-3])
def test_the_spacing_of_a_measured_profile_is_what_gwyddion_counts(cutoff: float) -> None:
    """Peaks and valleys of more than a tenth of Rz by another program's count, over the same sections."""
    library = gwyddion()
    if library is None or not STYLUS.is_file():
        pytest.skip("Gwyddion's library (Debian: libgwyddion20) or the stylus profile is not there")
    x, z, valid = np.genfromtxt(STYLUS, delimiter=";", skip_header=2).T
    even = np.linspace(x[valid == 1].min(), x[valid == 1].max(), int(valid.sum()))
    heights = 1e-3 * np.interp(even, x[valid == 1], z[valid == 1])
    heights -= np.polyval(np.polyfit(even - even.mean(), heights, 2), even - even.mean())
    step = 1e-3 * float(even[1] - even[0])
    values, sections = profile_parameters([Stretch(heights, np.ones(len(heights), dtype=bool), step)], cutoff)
    size, end = round(cutoff / step), round(0.5 * cutoff / step)
    rough = (heights - gaussian_mean(heights, step, cutoff))[end : end + sections * size]
    told = [spacing_of_peaks(library, sign * rough, 0.1 * values["Rz"].median) for sign in (1.0, -1.0)]
    spacing = step * sum(length for length, _ in told) / sum(count for _, count in told)
    assert values["Rsm"].median == pytest.approx(spacing, rel=1e-3)
