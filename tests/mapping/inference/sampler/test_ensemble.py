"""The sampler on densities whose moments are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from mapping.inference.sampler.ensemble import (
    FIRST_LOOK,
    LONGEST_CHAIN,
    MOST_CHAIN_VALUES,
    _autocorrelation,
    sample_ensemble,
    steps_for,
)
from mapping.inference.sampler.importance import importance_sample
from mapping.inference.sampler.laplace import Laplace


@dataclass(frozen=True)
class Gaussian:
    """A target with the interface that the sampler needs."""

    scale: np.ndarray

    def log_density(self, theta):
        return -0.5 * ((theta / self.scale) ** 2).sum(axis=1)


@dataclass(frozen=True)
class TwoModes:
    def log_density(self, theta):
        near, far = -0.5 * (theta**2).sum(axis=1), -0.5 * (((theta - 12.0) / 0.5) ** 2).sum(axis=1)
        return np.logaddexp(near, far + np.log(3.0 / 0.25))


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e6])
def test_the_ensemble_has_the_variance_of_its_target_at_every_scale(scale):
    target = Gaussian(scale * np.array([1.0, 3.0, 0.1]))
    rng = np.random.default_rng(5)
    chain = sample_ensemble(target, target.scale * rng.standard_normal((20, 3)), rng)
    assert chain.status == "converged"
    ratio = chain.samples.var(axis=0) / target.scale**2
    np.testing.assert_allclose(ratio, 1.0, atol=5 * np.sqrt(2 / chain.ess))


def test_an_interruption_passes_through_in_silence(capfd):
    """emcee would print all walkers and a traceback before what ends the run says so itself."""

    @dataclass(frozen=True)
    class Interrupted:
        def log_density(self, theta):
            raise KeyboardInterrupt

    rng = np.random.default_rng(0)
    with pytest.raises(KeyboardInterrupt):
        sample_ensemble(Interrupted(), rng.standard_normal((8, 2)), rng)
    assert capfd.readouterr() == ("", "")


def test_an_ensemble_that_cannot_move_says_so():
    @dataclass(frozen=True)
    class Spike:
        def log_density(self, theta):
            return np.where((theta == 0.0).all(axis=1), 0.0, -np.inf)

    chain = sample_ensemble(Spike(), np.zeros((20, 2)), np.random.default_rng(0), max_steps=200)
    assert chain.status == "stuck" and "accepted" in chain.reason


def test_a_chain_cut_short_says_so():
    target, rng = Gaussian(np.ones(4)), np.random.default_rng(0)
    chain = sample_ensemble(target, rng.standard_normal((20, 4)), rng, max_steps=300)
    assert chain.status == "chain too short"


def test_a_walker_that_has_not_moved_is_not_taken_for_independent_draws():
    chain = np.random.default_rng(0).standard_normal((400, 20, 2))
    assert _autocorrelation(chain) < 2.0
    chain[:, 7] = chain[0, 7]
    assert _autocorrelation(chain) == len(chain)


def test_the_same_generator_gives_the_same_chain():
    def run():
        rng = np.random.default_rng(3)
        return sample_ensemble(Gaussian(np.ones(2)), rng.standard_normal((16, 2)), rng).samples

    np.testing.assert_array_equal(run(), run())


def test_importance_sampling_finds_moments_and_evidence_from_a_poor_start():
    target, rng = Gaussian(np.array([1.0, 5.0])), np.random.default_rng(1)
    fast = importance_sample(target, [Laplace(np.array([1.0, -3.0]), np.diag([4.0, 1.0]), 0.0)], rng)
    assert fast.k_hat < 0.5
    mean = fast.weights @ fast.draws
    variance = fast.weights @ (fast.draws - mean) ** 2
    np.testing.assert_allclose(variance / target.scale**2, 1.0, atol=0.12)
    assert fast.log_evidence == pytest.approx(np.log(2 * np.pi * 5.0), abs=0.05)


def test_two_modes_get_their_shares():
    modes = [Laplace(np.zeros(2), np.eye(2), 0.0), Laplace(np.full(2, 12.0), 0.25 * np.eye(2), 0.0)]
    rng = np.random.default_rng(2)
    fast = importance_sample(TwoModes(), modes, rng)
    assert fast.weights @ (fast.draws[:, 0] > 6) == pytest.approx(0.75, abs=0.03)
    chain = sample_ensemble(TwoModes(), fast.draws[:20], rng, proposal=fast.proposal)
    assert chain.status == "converged"
    assert (chain.samples[:, 0] > 6).mean() == pytest.approx(0.75, abs=0.06)


def test_a_chain_over_many_bins_takes_fewer_steps() -> None:
    assert steps_for(500, 24) == LONGEST_CHAIN
    assert FIRST_LOOK <= steps_for(3000, 20) < LONGEST_CHAIN
    assert steps_for(3000, 20) * 3000 * 20 <= MOST_CHAIN_VALUES
