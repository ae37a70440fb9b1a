"""Posteriors of features whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from recorded_features import (
    CROSSINGS,
    ENDS,
    GUESS,
    SLIDES,
    TIP,
    WHITE,
    D,
    feature,
    inside,
    line,
    plate,
    record,
    wire,
)

from mapping.base.base import Base
from mapping.base.projection import onto_base
from mapping.feature import Details, Interval
from mapping.geometry.templates.shapes import cap_height, groove_height, rim_height, step_height
from mapping.inference import feature_posterior
from mapping.inference.feature_posterior import (
    Solution,
    _from_importance,
    _hardly_spoken_for,
    refine,
    sample_posterior,
    solve,
)
from mapping.inference.sampler.psis import resample
from mapping.inference.summary import describe
from mapping.instrument.noise import Noise
from mapping.surface import Surface


@pytest.fixture(scope="module")
def solved_wire() -> Solution:
    """The wire's posterior by both ways, which takes seconds: shared by those that look at it."""
    trace = record(CROSSINGS + SLIDES, wire(ENDS))
    return solve(GUESS, trace, np.random.default_rng(0), base=plate(), noise=WHITE)


def test_a_wire_is_found_with_its_ends_height_and_direction(solved_wire):
    found = describe(solved_wire.problem, solved_wire.posterior, plate())
    assert found.posterior.status == "converged"
    order = found.axis[[0, -1]] if found.axis[0, 0] < 0 else found.axis[[-1, 0]]
    np.testing.assert_allclose(order, ENDS, atol=0.12e-3)
    assert inside(found.height, D, 3e-6) and inside(found.width, D) and inside(found.length, 31.004e-3, 30e-6)
    assert not found.length.censored and found.length.high - found.length.low < 0.4e-3
    assert found.position_sd < 30e-6


def test_importance_sampling_and_emcee_agree(solved_wire):
    fast, chain = solved_wire.importance, solved_wire.posterior.samples
    mean = fast.weights @ fast.draws
    sd = np.sqrt(fast.weights @ (fast.draws - mean) ** 2)
    assert fast.k_hat < 0.7
    np.testing.assert_array_less(np.abs(chain.mean(axis=0) - mean) / sd, 0.15)
    # the spread by quantiles: the tails of the radius are so long that the standard deviation of 2000 draws is 8 % off
    draws = fast.draws[resample(np.random.default_rng(1), fast.weights, 20_000)]
    spreads = [np.ptp(np.quantile(each, [0.05, 0.95], axis=0), axis=0) for each in (chain, draws)]
    np.testing.assert_allclose(spreads[0] / spreads[1], 1.0, atol=0.12)


def test_the_fast_path_answers_alone_where_it_can_be_trusted():
    trace = record(CROSSINGS + SLIDES, wire(ENDS))
    posterior = sample_posterior(GUESS, trace, np.random.default_rng(0), base=plate(), noise=WHITE, confirm=False)
    assert posterior.status == "not needed" and posterior.k_hat < 0.5
    assert np.isnan(posterior.tau) and posterior.ess > 500


def test_under_noise_that_was_raised_to_a_misfit_all_crossings_together_say_whether_a_chain_is_worth_it(monkeypatch):
    monkeypatch.setattr(feature_posterior, "_log_odds", lambda *_: -5.0)
    fitting, misfitting = (SimpleNamespace(misfit=misfit, feature=GUESS) for misfit in (0.0, 9.0))
    assert _hardly_spoken_for(fitting, None, None)
    assert not _hardly_spoken_for(misfitting, None, None)
    assert _hardly_spoken_for(misfitting, None, SimpleNamespace(log_odds=-4.0))
    assert not _hardly_spoken_for(misfitting, None, SimpleNamespace(log_odds=40.0))


def test_the_same_seed_gives_the_same_draws():
    trace = record([line((-10e-3, 0), (10e-3, 0))], lambda feet: cap_height(feet[:, 0], 0.5e-3, 3e-3, TIP))
    guess = feature("bump", (0, 0, 0), 0.4e-3, 1e-3)
    runs = [sample_posterior(guess, trace, np.random.default_rng(7), base=plate(), noise=WHITE) for _ in range(2)]
    assert runs[0].status == "converged"
    np.testing.assert_array_equal(runs[0].samples, runs[1].samples)


def test_an_end_that_was_not_explored_is_censored():
    trace = record(CROSSINGS, wire([(-80e-3, 0, 0), (4e-3, 0, 0)]))
    found = refine(GUESS, trace, np.random.default_rng(0), base=plate(), noise=WHITE, confirm=False)
    assert found.length.censored and any("beyond what was explored" in note for note in found.notes)
    # it is sure as far as it was felt: from the first crossing to the end that was seen, and no farther
    assert 10e-3 < found.length.low < 4e-3 - min(path[0, 0] for path in CROSSINGS) + 0.1e-3


@pytest.mark.slow
def test_zigzag_leaves_the_end_anywhere_between_two_sweeps():
    # crossings 16 mm apart: beyond 3.6 mm from either, nothing is felt of the end
    paths = [line((x, -12e-3), (x, 12e-3)) for x in (-32e-3, -16e-3, 0.0, 16e-3, 32e-3)]
    guess = feature("ridge", [(-16e-3, 0, 0), (16e-3, 0, 0)], 0.6e-3, 0.6e-3, crossings=3)
    trace = record(paths, wire([(-24e-3, 0, 0), (24e-3, 0, 0)]), Noise(5e-6))
    posterior = sample_posterior(guess, trace, np.random.default_rng(0), base=plate(), noise=Noise(5e-6))
    gap = 16e-3 - contact_reach()
    for name in ("start", "end"):
        assert posterior.draws(name).std() == pytest.approx(gap / np.sqrt(12), rel=0.15)


def contact_reach():
    """Distance at which a sweep across the end's extension still feels it: half of what no sweep feels is hidden."""
    from mapping.geometry.templates.shapes import contact_half_width

    return float(contact_half_width(D, D / 2, TIP))


def test_a_bump_is_found_in_two_dimensions():
    center, radius, height = np.array([0.4e-3, -0.3e-3, 0]), 2e-3, 0.5e-3
    paths = [line((x, -9e-3), (x, 9e-3)) for x in (-1.5e-3, 0.5e-3)] + [line((-9e-3, 0.0), (9e-3, 0.0))]
    truth = lambda feet: cap_height(np.linalg.norm(feet - center, axis=1), height, radius, TIP)  # noqa: E731
    guess = feature("bump", (0, 0, 0), 0.4e-3, 1e-3)
    found = refine(guess, record(paths, truth), np.random.default_rng(0), base=plate(), noise=WHITE, confirm=False)
    np.testing.assert_allclose(found.axis[0], center, atol=4 * found.position_sd)
    assert found.position_sd < 80e-6 and inside(found.height, height, 5e-6)
    assert found.length.high == 0.0


def test_a_lone_profile_gives_a_crest_not_a_place_in_space():
    truth = lambda feet: cap_height(feet[:, 0] - 0.2e-3, 0.5e-3, 3e-3, TIP)  # noqa: E731
    trace = record([line((-10e-3, 0), (10e-3, 0))], truth)
    found = refine(feature("bump", (0, 0, 0), 0.4e-3, 1e-3), trace, np.random.default_rng(0), base=plate(), noise=WHITE)
    assert found.posterior.names == ("along", "height", "log radius")
    assert found.axis[0, 0] == pytest.approx(0.2e-3, abs=4 * found.position_sd)
    assert any("single sweep" in note for note in found.notes)


def dilated(body, x, tip=TIP):
    """Heights of the ball over a profile z(x) by brute force."""
    u = np.linspace(-15e-3, 15e-3, 6001)
    z = body(u)
    gap = np.minimum(np.abs(x[:, None] - u), tip)
    return (z - gap**2 / (tip + np.sqrt((tip - gap) * (tip + gap)))).max(axis=1)


FINE = Noise(10e-6)


def refined_profile(height_at, noise=FINE):
    trace = record([line((-10e-3, 0), (10e-3, 0), 24e-6)], lambda feet: height_at(feet[:, 0]), noise)
    guess = feature("bump", (0, 0, 0), 0.4e-3, 1e-3)
    return refine(guess, trace, np.random.default_rng(0), base=plate(), noise=noise, confirm=False)


def test_a_bump_that_no_shape_fits_says_so_and_a_cap_does_not():
    cap = refined_profile(lambda x: cap_height(x, 0.5e-3, 3e-3, TIP))
    lopsided = refined_profile(lambda x: 0.5e-3 / (1.0 + (x / np.where(x > 0, 3e-3, 0.7e-3)) ** 2))
    assert "no ideal" not in " ".join(cap.notes) and cap.details.scale is None
    assert "no ideal bump fits" in " ".join(lopsided.notes)


def test_the_papers_bump_has_the_height_of_its_skirted_body():
    # z = H/(1 + (u/w)^2), the paper's bump of revolution: a cap fitted to its trace is 15 % too low
    found = refined_profile(lambda x: dilated(lambda u: 0.6e-3 / (1.0 + (u / 1.2e-3) ** 2), x))
    assert "no ideal" not in " ".join(found.notes) and any("runs out" in note for note in found.notes)
    assert inside(found.height, 0.6e-3) and found.height.high - found.height.low < 0.1e-3
    assert inside(found.width, 2.4e-3, 20e-6)
    assert abs(np.log(found.details.exponent)) < 0.5


def test_a_groove_and_its_hidden_bottom():
    width = 3e-3
    ends = np.array([-14e-3, 15e-3])

    def truth(feet):
        along = np.minimum(feet[:, 0] - ends[0], ends[1] - feet[:, 0])
        return np.maximum(groove_height(feet[:, 1], width, TIP), rim_height(along, TIP))

    guess = feature("groove", [(-9e-3, 0.1e-3, 0), (9e-3, 0, 0)], -0.1e-3, 2.5e-3)
    trace = record(CROSSINGS + SLIDES, truth, Noise(10e-6))
    found = refine(guess, trace, np.random.default_rng(0), base=plate(), noise=Noise(10e-6), confirm=False)
    assert inside(found.width, width, 10e-6) and found.height.censored
    assert found.height.median == pytest.approx(-0.1131e-3, abs=3e-6)
    assert inside(found.length, np.ptp(ends), 30e-6)


def test_a_pit_with_a_bottom_has_its_depth():
    paths = [line((x, -9e-3), (x, 9e-3)) for x in (-0.5e-3, 0.5e-3)] + [line((-9e-3, 0.0), (9e-3, 0.0))]
    truth = lambda feet: rim_height(2e-3 - np.linalg.norm(feet, axis=1), TIP, depth=0.1e-3)  # noqa: E731
    trace = record(paths, truth, Noise(10e-6))
    guess = feature("pit", (0.2e-3, 0.1e-3, 0), -0.1e-3, 3e-3)
    found = refine(guess, trace, np.random.default_rng(0), base=plate(), noise=Noise(10e-6), confirm=False)
    assert not found.height.censored and inside(found.height, -0.1e-3, 1e-6) and inside(found.width, 4e-3, 20e-6)


@pytest.mark.slow
def test_a_high_step_felt_finely_is_found_from_beside_it():
    # between single samples the steep foot of the arc makes hollows in the density, and a doubtful tip goes with them
    noise = Noise(25e-6)
    paths = [line((x, -25e-3), (x, 25e-3), 0.25e-3) for x in np.linspace(-10e-3, 10e-3, 11)]
    trace = record(paths, lambda feet: step_height(-feet[:, 1], 5e-3, TIP), noise)
    for beside in (-2e-3, 3e-3, 5e-3):
        guess = feature("step", [(-10e-3, beside, 0), (10e-3, beside, 0)], 5e-3, 0.0)
        guess = replace(guess, height=Interval.normal(5.02e-3, 5e-6), position_sd=5e-6)
        rng = np.random.default_rng(0)
        found = refine(guess, trace, rng, base=plate(), noise=noise, tip_sd=0.1e-3, confirm=False)
        assert abs(found.axis[:, 1]).max() < 0.05e-3
        assert inside(found.height, 5e-3, 5e-6) and found.height.high - found.height.low < 20e-6
        assert not any("no ideal" in note for note in found.notes)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_step_up_to_either_side(side):
    truth = lambda feet: step_height(side * (feet[:, 1] - 0.2e-3), 0.4e-3, TIP)  # noqa: E731
    guess = feature("step", [(-9e-3, 0, 0), (9e-3, 0, 0)], 0.35e-3, 0.0)
    found = refine(guess, record(CROSSINGS, truth), np.random.default_rng(0), base=plate(), noise=WHITE, confirm=False)
    assert inside(found.height, 0.4e-3, 3e-6)
    np.testing.assert_allclose(found.axis[:, 1], 0.2e-3, atol=0.1e-3)


def test_kinds_without_a_closed_form_come_back_with_a_note():
    same = refine(feature("convex edge", GUESS.axis, D, D), record(CROSSINGS, wire(ENDS)), np.random.default_rng(0))
    assert same.posterior is None and "no closed-form" in same.notes[0]


@pytest.mark.slow
def test_a_tip_of_unknown_radius_widens_the_wire_and_nothing_else():
    # only a + r counts under a ball: 0.2 mm that are not known of the tip are not known of the wire
    def answer(tip_sd, seed=0):
        trace = record([line((x, -10e-3), (x, 10e-3), 24e-6) for x in (-3e-3, 0.0, 3e-3)], big, FINE)
        guess = feature("bump", (0, 0, 0), 1.4e-3, 3e-3)
        rng = np.random.default_rng(seed)
        return sample_posterior(guess, trace, rng, base=plate(), noise=FINE, tip_sd=tip_sd, confirm=False)

    big = lambda feet: cap_height(np.linalg.norm(feet, axis=1), 1.5e-3, 3e-3, TIP)  # noqa: E731
    known, free = answer(0.0), answer(0.2e-3)
    assert free.names[-1] == "tip radius" and free.names[:-1] == known.names
    assert free.draws("height").std() < 1.5 * known.draws("height").std()
    radius = np.exp(free.draws("log radius"))
    assert radius.std() == pytest.approx(0.2e-3, rel=0.25)
    assert radius.std() > 3.0 * np.exp(known.draws("log radius")).std()
    np.testing.assert_allclose((radius + free.draws("tip radius")).mean(), 13e-3, atol=0.05e-3)


@pytest.mark.slow
def test_the_length_of_all_likely_families_under_a_tip_of_unknown_radius():
    # a wire's section is hardly felt: several families stay likely, each with the free tip about its shape
    trace = record(CROSSINGS + SLIDES, wire(ENDS))
    found = refine(GUESS, trace, np.random.default_rng(0), base=plate(), noise=WHITE, tip_sd=0.1e-3, confirm=False)
    assert inside(found.length, np.hypot(*np.diff(np.array(ENDS)[:, :2], axis=0)[0]), 20e-6)


def test_a_second_wire_near_by_is_taken_into_account():
    # closer than 2 x_c = 7.2 mm
    other_ends = [(-15e-3, 5e-3, 0), (16e-3, 5e-3, 0)]
    both = lambda feet: np.maximum(wire(ENDS)(feet), wire(other_ends)(feet))  # noqa: E731
    other = feature("ridge", other_ends, D, D)
    other = replace(other, details=Details(radius=D / 2))
    trace = record(CROSSINGS + SLIDES, both)
    found = refine(
        GUESS, trace, np.random.default_rng(0), base=plate(), noise=WHITE, others=(GUESS, other), confirm=False
    )
    assert inside(found.height, D, 5e-6)
    assert abs(found.axis[:, 1].mean() - 0.05e-3) < 60e-6


@pytest.mark.slow
def test_a_ring_keeps_its_course_where_sweeps_graze_it():
    # The crossings of sweeps that graze a ring lie up to 1 mm beside it: its axis is the trace's to say
    radius, turn = 18e-3, np.linspace(0.0, 2.0 * np.pi, 181)
    ring = radius * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    ring[-1] = ring[0]
    trace = record([line((-28e-3, y), (28e-3, y), 24e-6) for y in np.arange(-19e-3, 20e-3, 3.8e-3)], wire(ring))
    angles = np.concatenate(
        [np.arcsin(np.arange(-15.2, 16, 3.8) / 18), np.pi - np.arcsin(np.arange(-15.2, 16, 3.8) / 18)]
    )
    wrong = radius + np.where(np.abs(np.sin(angles)) > 0.8, 0.8e-3, 0.05e-3) * np.sign(np.sin(7 * angles))
    order = np.argsort(angles)
    found = np.column_stack([wrong * np.cos(angles), wrong * np.sin(angles), 0.0 * angles])[order]
    guess = feature("ridge", np.concatenate([found, found[:1]]), 0.6e-3, D, crossings=len(found), sd=50e-6)
    refined = refine(guess, trace, np.random.default_rng(0), base=plate(), noise=WHITE, confirm=False)
    off = np.linalg.norm(refined.axis[:, :2], axis=1) - radius
    assert np.sqrt(np.mean(off**2)) < 40e-6 and inside(refined.height, D, 4e-6)


def test_a_faceted_base_does_not_shake_the_axis():
    # A pipe of 120 facets: feet of centres 10 mm above it lie up to 0.26 mm beside the axis
    sides, radius = 120, 40e-3
    turn = 2.0 * np.pi * np.arange(sides) / sides
    rings = [np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(sides, z)]) for z in (-0.05, 0.05)]
    k = np.arange(sides)
    low, up = (
        np.stack([k, (k + 1) % sides, k + sides], 1),
        np.stack([(k + 1) % sides, (k + 1) % sides + sides, k + sides], 1),
    )
    base = Base(Surface(np.concatenate(rings), np.concatenate([low, up])))
    course = np.linspace(0.1, 1.0, 40)
    axis = np.column_stack([radius * np.cos(course), radius * np.sin(course), 0.02 * course])
    normals = axis * [1.0, 1.0, 0.0] / radius
    points, _ = onto_base(axis, normals, base, TIP, smooth=4)
    around = np.arctan2(points[:, 1], points[:, 0]) - course
    assert np.abs(radius * around).max() < 2e-6 and np.abs(points[:, 2] - axis[:, 2]).max() < 1e-9
    assert np.abs(np.hypot(points[:, 0], points[:, 1]) - radius).max() < 14e-6


@pytest.mark.parametrize(("k_hat", "status"), [(0.3, "not needed"), (0.8, "chain too short")])
def test_importance_sampling_that_no_chain_may_follow_says_whether_it_can_be_trusted(k_hat: float, status: str) -> None:
    shape = SimpleNamespace(names=("height",), units=("m",))
    problem = SimpleNamespace(target=SimpleNamespace(shape=shape))
    fast = SimpleNamespace(draws=np.ones((50, 1)), weights=np.full(50, 0.02), k_hat=k_hat, ess=10.0)
    posterior = _from_importance(problem, fast, np.random.default_rng(0))
    assert posterior.status == status and f"k-hat {k_hat:.2f}" in posterior.reason
