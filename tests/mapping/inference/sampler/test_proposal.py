"""Proposals: what importance sampling draws from does not depend on the last digits of what it was learnt from."""

from __future__ import annotations

import numpy as np

from mapping.inference.sampler.proposal import Proposal, root_of


def learned(scale: float = 1.0, off: float = 0.0) -> Proposal:
    """A proposal learnt in some rounds, all lengths times a scale; its draws off by a relative error."""
    rng = np.random.default_rng(7)
    covariance = np.array([[4.0, 1.9], [1.9, 1.0]]) * (scale * (1.0 + off)) ** 2
    proposal = Proposal(
        np.array([0.5, 0.5]), scale * np.array([[0.3, 0.1], [1.0, 0.7]]), np.stack([root_of(covariance)] * 2)
    )
    for _ in range(6):
        draws = proposal.draw(rng.random(400), rng.standard_normal((400, 2)), rng.chisquare(6.0, 400))
        ratios = -0.5 * (draws / scale) ** 2 @ [1.0, 2.0] - proposal.log_density(draws)
        weights = np.exp(ratios - ratios.max())
        proposal = proposal.learned(draws, weights / weights.sum())
    return proposal


def test_rounding_errors_are_forgotten() -> None:
    one, other = learned(), learned(off=1e-11)
    for name in ("shares", "means", "roots"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


def test_powers_of_two_as_units_change_nothing() -> None:
    one, other = learned(), learned(2.0**-10)
    assert np.array_equal(one.shares, other.shares)
    assert np.array_equal(one.means, 2.0**10 * other.means) and np.array_equal(one.roots, 2.0**10 * other.roots)


def test_what_is_told_is_the_same_to_three_digits() -> None:
    root = root_of(np.array([[4e-12, 1.9e-7], [1.9e-7, 1e-2]]))
    told = Proposal(np.array([1.0]), np.array([[3e-3, 5.0]]), root[None]).rounded()
    np.testing.assert_allclose(told.roots[0] @ told.roots[0].T, root @ root.T, rtol=2e-3)
    assert (np.abs(told.means - [3e-3, 5.0]) < 1e-3 * np.sqrt(np.diag(root @ root.T))).all()
