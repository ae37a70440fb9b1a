"""Detection on closed-form traces of wires, bumps and grooves on a plate, and on a real stylus profile."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from mapping.base.base import Base
from mapping.base.height_profile import SweepHeights, height_profiles
from mapping.detection import cap_fit
from mapping.detection.candidates import search
from mapping.detection.detect import Detections, detect
from mapping.detection.filters.false_alarms import _intensity, false_alarm_rate, threshold_for
from mapping.detection.filters.matched_filter import build_bank, filter_sd
from mapping.detection.quiet_noise import _uncertainty, floored
from mapping.errors import DetectionError
from mapping.geometry.templates.shapes import cap_height, groove_height, step_height
from mapping.instrument.block_likelihood import NoiseFit
from mapping.instrument.noise import Noise
from mapping.surface import Surface
from mapping.trace import Trace

TIP, SPACING = 0.01, 6e-6
PROFILE = Path(__file__).parents[4] / "shared" / "data" / "stylus_profile_mm.csv"
LISTED = [8.9472, 9.0975, 9.1980, 9.8167, 10.0697, 10.2975, 10.5805, 10.6180, 10.9917, 12.0632, 12.0745, 12.2570]
LISTED += [12.9047, 12.9175, 13.0440, 13.0672, 13.4167]


def plate() -> Base:
    corners = 0.2 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))


def sweep(height, length: float = 0.1, white: float = 0.0, seed: int = 0) -> Trace:
    x = np.arange(-length / 2, length / 2, SPACING)
    rng = np.random.default_rng(seed)
    z = TIP + height(x) + white * rng.standard_normal(len(x))
    return Trace.from_profile(x, z, TIP, x / 0.03)


def wire(x, diameter: float = 0.65e-3, place: float = 0.0):
    return cap_height(x - place, diameter, diameter / 2, TIP)


def test_without_noise_a_wire_is_measured_to_its_binning():
    found = detect(sweep(wire), plate())
    (crossing,) = found.crossings
    assert crossing.kind == "convex"
    assert crossing.curvature_feature
    assert abs(crossing.point[0]) < 1e-6
    np.testing.assert_allclose(crossing.height, 0.65e-3, rtol=0.02)
    np.testing.assert_allclose(crossing.trace_curvature, 1 / (TIP + 0.325e-3), rtol=0.1)


def test_what_is_not_known_of_a_noise_below_rounding_makes_no_threshold_uncertain():
    few = np.eye(3)  # of samples so few that the level of each part is known to half of itself
    for white, doubt in ((1e-6, 0.5), (1e-16, 0.0)):
        noise = Noise(white, 1e-3 * white, 1e-3)
        bank = build_bank(floored(noise, TIP), 0.1e-3, 10.0, 0.5e-3, 2e-3)
        assert _uncertainty(NoiseFit(noise, few), bank, TIP) == pytest.approx(doubt, abs=0.02)


def test_a_wire_under_the_noise_of_the_apparatus_is_found_where_it_is():
    errors = []
    for seed in range(10):
        found = detect(sweep(wire, white=2e-4, seed=seed), plate())
        (crossing,) = found.crossings
        errors.append(crossing.point[0])
        assert abs(crossing.height - 0.65e-3) < 4 * crossing.height_sd
        np.testing.assert_allclose(found.noise.white, 2e-4, rtol=0.05)
    # the bound sigma/D sqrt(3 Delta x_c / 8) is 0.028 mm when the size is known
    assert np.sqrt(np.mean(np.square(errors))) < 0.06e-3


def test_a_bare_plate_holds_nothing_with_and_without_noise():
    assert detect(sweep(np.zeros_like), plate()).crossings == ()
    assert detect(sweep(np.zeros_like, white=2e-4), plate()).crossings == ()


def test_wires_above_the_stated_limit_are_found_and_far_below_it_are_not():
    limit = detect(sweep(np.zeros_like, white=2e-4), plate()).detection_limit
    assert 0.06e-3 < limit < 0.13e-3
    seen = [
        len(detect(sweep(lambda x, d=factor * limit: wire(x, d), white=2e-4, seed=seed), plate()).crossings)
        for factor in (1.3, 0.4)
        for seed in range(6)
    ]
    assert sum(seen[:6]) >= 5
    assert sum(seen[6:]) <= 1


def test_a_groove_is_concave_and_sharp_and_a_step_goes_up_and_comes_down():
    (groove,) = detect(sweep(lambda x: groove_height(x, 3e-3, TIP), white=1e-5), plate()).crossings
    assert groove.kind == "concave"
    assert groove.height < 0
    (up,) = detect(sweep(lambda x: step_height(x, 0.4e-3, TIP), white=1e-5), plate()).crossings
    (down,) = detect(sweep(lambda x: step_height(-x, 0.4e-3, TIP), white=1e-5), plate()).crossings
    assert (up.kind, down.kind) == ("step up", "step down")
    np.testing.assert_allclose(up.height, 0.4e-3, rtol=0.05)
    assert abs(up.point[0]) < 0.5e-3


def test_sweeps_too_short_to_inspect_say_nothing_about_the_noise():
    long = sweep(wire, white=1e-4, seed=1)
    stubs = [sweep(lambda x: np.full(len(x), 0.5e-3), length=1.5e-3, white=1e-4, seed=k) for k in range(4)]
    parts = [replace(part, t=part.t + 10 * k, sweep=np.full(len(part), k)) for k, part in enumerate([long, *stubs])]
    found = detect(Trace.concatenate(parts), plate())
    assert found.noise.correlated == 0
    np.testing.assert_allclose(found.noise.white, 1e-4, rtol=0.03)
    assert [c.sweep for c in found.crossings] == [0]


def test_two_wires_nearer_than_their_disturbances_are_two():
    both = sweep(lambda x: np.maximum(wire(x, place=-2e-3), wire(x, place=2.5e-3)), white=2e-5)
    places = [c.point[0] for c in detect(both, plate()).crossings]
    np.testing.assert_allclose(places, [-2e-3, 2.5e-3], atol=2e-4)


def test_a_reversed_sweep_tells_the_same():
    there = sweep(wire, white=1e-4, seed=4)
    back = there.select(np.arange(len(there))[::-1])
    (a,), (b,) = detect(there, plate()).crossings, detect(back, plate()).crossings
    np.testing.assert_allclose(a.point, b.point, atol=0.3 * a.position_sd)
    np.testing.assert_allclose(a.tangent, -b.tangent, atol=1e-2)


def bare_profile(samples: np.ndarray, rng: np.random.Generator) -> SweepHeights:
    """White noise of 0.2 mm in bins of 0.1 mm with so many samples each."""
    count = len(samples)
    first = np.concatenate([[0], np.cumsum(samples)]).round().astype(np.int64)
    height = rng.standard_normal(count) * 2e-4 / np.sqrt(samples)
    usual = float(np.median(samples))
    return SweepHeights(0, 0.0, 1e-4, height, usual, first, np.arange(float(count)), np.zeros((count, 3)))


def test_where_samples_are_scarce_the_noise_they_leave_is_no_feature():
    samples = np.full(10_000, 20.0)
    samples[3000:5000] = 3.0
    bank = build_bank(Noise(2e-4), 1e-4, float(np.median(samples)), 1.4e-3, 0.02)
    threshold, rng = threshold_for(bank, 1.0), np.random.default_rng(8)
    found = sum(
        len(search(bare_profile(samples, rng), bank, bank.noise, threshold, TIP).disturbances) for _ in range(12)
    )
    # 99.9 % of a Poisson number with mean 12
    assert found <= 24


@pytest.mark.parametrize("drift", [0, pytest.param(2, marks=pytest.mark.slow)])
def test_false_alarms_come_as_often_as_asked(drift):
    noise, spacing, samples, rate = Noise(2e-4), 1e-4, 16.7, 1.0
    bank = build_bank(noise, spacing, samples, 1.4e-3, 0.02, drift)
    threshold = threshold_for(bank, rate)
    np.testing.assert_allclose(false_alarm_rate(bank, threshold), rate, rtol=0.15)
    rng = np.random.default_rng(7)
    metres, found = 80, 0
    for _ in range(metres):
        found += len(search(bare_profile(np.full(10_000, samples), rng), bank, noise, threshold, TIP).disturbances)
    # 99 % of a Poisson number with mean 80
    assert 57 <= found <= 104


def test_a_threshold_is_worked_out_once_for_sweeps_that_differ_little():
    noise = Noise(2e-4, 1e-4, 1e-3)
    first = threshold_for(build_bank(noise, 1.2e-4, 20.0, 1.45e-3, 0.04), 0.01)
    known = _intensity.cache_info().misses
    others = [threshold_for(build_bank(noise, 1.2e-4 * f, 20.0 * f, 1.45e-3 * f, 0.04), 0.01) for f in (0.9999, 1.0001)]
    np.testing.assert_allclose(others, first, rtol=1e-3)
    assert _intensity.cache_info().misses == known


def test_a_threshold_on_uncertain_noise_is_that_of_student():
    from scipy.stats import norm, t

    bank = build_bank(Noise(2e-4), 1.2e-4, 20.0, 1.45e-3, 0.04)
    normal = threshold_for(bank, 0.01)
    assert threshold_for(bank, 0.01, 1e-3) == normal
    # a level known to 10 % has 50 degrees of freedom
    np.testing.assert_allclose(threshold_for(bank, 0.01, 0.1), t.isf(norm.sf(normal), 50), rtol=1e-9)


def test_filters_of_a_remembered_bank_are_those_of_its_own_noise():
    noise, spacing, samples = Noise(2e-4, 1.5e-4, 1.3e-3), 1.37e-4, 22.8
    for f in build_bank(noise, spacing, samples, 1.5e-3, 0.04).filters:
        np.testing.assert_allclose(f.sd, filter_sd(f.half_width, noise, spacing, samples, 0), rtol=5e-3)
        assert f.half_width >= 1.49e-3


@pytest.mark.parametrize("at", [0.02, 0.034])
def test_the_far_lobe_of_a_wide_filter_is_no_detail(at):
    """Over a base that is not known each filter looks 3.5 half-widths far: one saw a second crest 26 mm away."""
    spacing, noise = 20e-6, Noise(1e-5, 0.0, 1e-3)
    u = spacing * np.arange(2000) - at
    height = np.maximum(4.4e-4 - u**2 / (2 * 10e-3), 0.0)
    height = height + 1e-5 * np.random.default_rng(4).standard_normal(len(u))
    centers = np.column_stack([u, np.zeros(len(u)), height])
    profile = SweepHeights(0, 0.0, spacing, height, 1.0, np.arange(len(u) + 1), u, centers)
    bank = build_bank(noise, spacing, 1.0, 1e-4, 1.2e-2, 3)
    (found,) = search(profile, bank, noise, 6.0, 10e-3).disturbances
    assert abs(found.place - at) < 1e-4


def test_detection_refuses_what_it_cannot_do():
    with pytest.raises(DetectionError, match="1, 2, 3 and 4"):
        detect(sweep(wire), plate(), algorithm=5)
    with pytest.raises(DetectionError, match="positive"):
        detect(sweep(wire), plate(), false_alarms_per_metre=0.0)
    still = Trace(np.arange(50.0), np.tile([0.0, 0, TIP], (50, 1)), np.zeros(50, dtype=int), TIP)
    (reason,) = detect(still, plate()).left_out
    assert "too few" in reason


ORDERS = {"as recorded": slice(None), "reversed": slice(None, None, -1), "every other sample": slice(None, None, 2)}
needs_profile = pytest.mark.skipif(not PROFILE.exists(), reason="the real stylus profile is not beside this repository")


@cache
def real(order: str) -> Detections:
    x, z = 1e-3 * np.genfromtxt(PROFILE, delimiter=";", skip_header=2)[:, :2].T
    return detect(Trace.from_profile(x[ORDERS[order]], z[ORDERS[order]], 2e-6))


@needs_profile
@pytest.mark.parametrize(
    "order", ["as recorded", "every other sample", pytest.param("reversed", marks=pytest.mark.slow)]
)
def test_a_real_stylus_profile_shows_its_bumps_and_hardly_a_pit(order):
    """At 12.647 mm a dent, five samples long and 28 nm deep, stands at the threshold."""
    found = real(order)
    places = 1e3 * np.array([c.point[0] for c in found.crossings])
    seen = sum(np.abs(places - listed).min() < 2e-3 for listed in LISTED)
    assert seen >= 15
    assert len(places) <= 40
    assert all(abs(c.height) > 4 * found.noise.sd for c in found.crossings)
    pits = [c for c in found.crossings if c.kind != "convex"]
    assert len(pits) <= 1 and all(c.snr < 1.5 * found.threshold for c in pits)


@needs_profile
@pytest.mark.parametrize("order", ["every other sample", pytest.param("reversed", marks=pytest.mark.slow)])
def test_places_on_a_real_stylus_profile_do_not_depend_on_how_it_was_sampled(order):
    one, other = real("as recorded"), real(order)
    # a single sample on the crest shows it; the limits are higher, for crests between two samples
    certain = max((found.threshold + 1.645) * found.noise.white for found in (one, other))
    places = np.array([c.point[0] for c in other.crossings])
    off = [np.abs(places - c.point[0]).min() for c in one.crossings if c.height > certain]
    assert len(off) >= 20
    # samples are 0.5 um apart
    assert max(off) < 0.2e-6
    assert abs(len(places) - len(one.crossings)) <= 6


def test_a_bin_that_a_sweep_only_ends_in_does_not_count_as_a_full_one() -> None:
    s = np.arange(1001) * 1e-4 + 0.5e-6
    centers = np.column_stack([s, np.zeros_like(s), np.full_like(s, 0.01)])
    centers[-1, 2] += 0.5e-3
    plate = Base(Surface([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]]))
    trace = Trace(np.arange(1001.0), centers, np.zeros(1001, dtype=np.int64), 0.01)
    (profile,) = height_profiles(0, trace, s, plate, 10e-4)
    assert len(profile.height) == 100
    assert np.abs(profile.height).max() < 1e-12


@pytest.mark.slow
def test_rounding_of_the_positions_is_no_feature_but_a_wire_beneath_it_is() -> None:
    step = 4e-6

    def rounded(height) -> Trace:
        trace = sweep(lambda x: height(x) + 1e-4 * np.exp(-((x + 0.05) / 0.02)), white=2e-7)
        leftover = trace.centers[:, 2] % step - step / 2
        centers = trace.centers.copy()
        centers[:, 2] = TIP + height(centers[:, 0]) + leftover
        return Trace(trace.t, centers, trace.sweep, TIP, resolution=step)

    flat = rounded(lambda x: 0.0 * x)
    unsaid = detect(replace(flat, resolution=0.0), plate())
    assert not unsaid.crossings and unsaid.remarks and unsaid.detection_limit > step
    silent = detect(flat, plate())
    assert not silent.crossings and "rounding" in silent.left_out[-1]
    assert silent.detection_limit >= step
    (crossing,) = detect(rounded(wire), plate()).crossings
    np.testing.assert_allclose(crossing.height, 0.65e-3, rtol=0.03)


def test_where_rounding_sets_the_limit_the_law_of_less_than_that_is_not_told() -> None:
    """What is kept stands out of the rounding; how the noise below that changes its level decides nothing."""
    trace = sweep(wire, white=1e-7)
    centers = trace.centers.copy()
    rough = np.random.default_rng(5).standard_normal(len(centers)) * np.where(centers[:, 0] > 0.01, 1e-6, 0.0)
    centers[:, 2] += rough
    uneven = Trace(trace.t, centers, trace.sweep, TIP)
    told = detect(uneven, plate())
    assert told.remarks
    rounded = detect(replace(uneven, resolution=4e-5), plate())
    assert not rounded.remarks
    assert rounded.detection_limit == 2.5 * 4e-5 > told.detection_limit
    (crossing,) = rounded.crossings
    np.testing.assert_allclose(crossing.height, 0.65e-3, rtol=0.03)


def test_a_tip_thrown_off_for_moments_changes_neither_the_noise_nor_the_wire() -> None:
    """Most of the path lies on the wire, and its flank comes in pieces: as from a force sensor that slides down it."""
    whole = sweep(wire, length=0.012, white=5e-7)
    x = whole.centers[:, 0]
    flying = (x > 1e-3) & (x < 3.5e-3) & (np.sin(x / 4e-5) > 0.8)
    far = (x > 2e-3) & (x < 2.5e-3)
    torn = whole.select(~flying & ~far)
    found = detect(torn, plate())
    assert 3e-7 < found.noise.sd < 2e-6
    strongest = max(found.crossings, key=lambda crossing: crossing.snr)
    np.testing.assert_allclose(strongest.height, 0.65e-3, rtol=0.02)


def test_sparse_sweeps_among_dense_ones_raise_no_more_false_alarms_than_asked() -> None:
    # bins narrower than a sweep's own samples were filled in between them, and counted as samples of their own
    rng, white = np.random.default_rng(8), 5e-6
    parts = []
    for number in range(160):
        step, count = (0.34e-3, 25) if number % 4 else (0.5e-3, 121)
        x = step * np.arange(count) - 0.03
        z = TIP + white * rng.standard_normal(count)
        centers = np.column_stack([x, np.full(count, 1e-4 * number), z])
        parts.append(Trace(number + x / 0.01, centers, np.full(count, number), TIP))
    trace = Trace.concatenate(parts)
    found = detect(trace, plate(), false_alarms_per_metre=4.0, noise=Noise(white))
    sparse = [c for c in found.crossings if c.sweep % 4 == 0]
    # 2.4 m of sparse sweeps: 9.6 expected; about 33 were found
    assert len(sparse) <= 20
    assert {round(1e5 * p) for p in np.diff(trace.centers[:25, 0])} == {50}


@pytest.mark.slow
def test_places_under_correlated_noise_lie_within_their_intervals() -> None:
    # the highest of the likelihood's tops is sharper than the truth is near: by its bend alone 90 % held 72 %
    noise, inside = Noise(2e-5, 4e-5, 1.5e-3), []
    x = np.arange(-0.1, 0.1, 6e-5)
    root = np.linalg.cholesky(noise.covariance(x))
    for seed in range(80):
        rng = np.random.default_rng([41, seed])
        place = rng.uniform(-0.01, 0.01)
        z = TIP + wire(x, 0.25e-3, place) + root @ rng.standard_normal(len(x))
        found = detect(Trace.from_profile(x, z, TIP, x / 0.03), plate(), noise=noise)
        near = [c for c in found.crossings if abs(c.point[0] - place) < 2e-3]
        inside += [abs(c.point[0] - place) < 1.6449 * c.position_sd for c in near[:1]]
    assert len(inside) > 60
    assert 0.82 <= np.mean(inside) <= 0.98


@pytest.mark.slow
def test_the_doubt_of_a_place_is_that_of_all_half_widths_however_finely_they_are_looked_at(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    noise = Noise(2e-5, 4e-5, 1.5e-3)
    x = np.arange(-0.1, 0.1, 6e-5)
    root = np.linalg.cholesky(noise.covariance(x))
    errors = [root @ np.random.default_rng([43, seed]).standard_normal(len(x)) for seed in range(16)]
    traces = [Trace.from_profile(x, TIP + wire(x, 0.25e-3) + each, TIP, x / 0.03) for each in errors]

    def doubts() -> np.ndarray:
        return np.array([c.position_sd for trace in traces for c in detect(trace, plate(), noise=noise).crossings])

    stated = doubts()
    monkeypatch.setattr(cap_fit, "SPREAD_WIDTHS", np.geomspace(1 / 3, 3, 193))
    assert len(stated) >= 12
    np.testing.assert_allclose(stated, doubts(), rtol=0.1)


def test_sweeps_detected_one_by_one_say_the_same_as_all_at_once() -> None:
    noise, each = Noise(2e-4), []
    for k in range(3):
        felt = sweep(lambda x, k=k: wire(x, place=0.01 * k), white=2e-4, seed=k)
        each.append(Trace(felt.t, felt.centers + np.array([0.0, 0.01 * k, 0.0]), np.full(len(felt), k), TIP))
    parts = Detections.together([detect(trace, plate(), noise=noise) for trace in each])
    whole = detect(Trace.concatenate(each), plate(), noise=noise)
    assert [c.sweep for c in parts.crossings] == [c.sweep for c in whole.crossings] == [0, 1, 2]
    places = [[c.point for c in found.crossings] for found in (parts, whole)]
    np.testing.assert_allclose(places[0], places[1], atol=1e-9)
    assert parts.inspected_length == pytest.approx(whole.inspected_length)
    assert (parts.threshold, parts.detection_limit) == pytest.approx((whole.threshold, whole.detection_limit), rel=1e-3)
