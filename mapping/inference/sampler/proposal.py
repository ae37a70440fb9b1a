"""Proposal: a mixture of multivariate Student t densities that learns a posterior from weighted draws."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import lgamma, log, pi

import numpy as np

from mapping import FloatArray

DEGREES = 6.0
# A component that explains less than this share of the draws is left as it is, to keep watch.
LEAST_SHARE = 0.01
# Binary digits that a proposal is told with. Learning makes ten times of a difference of 1e-10 in each round: of two
# forms of one recording that differ in the last digit the medians were a fiftieth of a standard deviation apart.
TOLD_DIGITS = 12


@dataclass(frozen=True, eq=False)
class Proposal:
    """A mixture of C multivariate t densities of DEGREES degrees of freedom.

    Args:
        shares: (C,) weights, summing to one.
        means: (C, P) places.
        roots: (C, P, P) Cholesky factors of the scale matrices.
    """

    shares: FloatArray
    means: FloatArray
    roots: FloatArray

    def rounded(self) -> Proposal:
        """The same, to TOLD_DIGITS: what it is learnt from may differ by rounding errors, and it does not.

        Weights make up for whatever a proposal is. Places are told in parts of their spread, spreads in parts of
        themselves, all by powers of two, so that a change of units by one of these changes nothing else.
        """
        spread = np.linalg.norm(self.roots, axis=2)
        grid = np.exp2(np.frexp(spread)[1] - TOLD_DIGITS)
        diagonal = np.einsum("cii->ci", self.roots)
        mantissa, power = np.frexp(diagonal)
        roots = np.rint(self.roots / grid[:, :, None]) * grid[:, :, None]
        np.einsum("cii->ci", roots)[:] = np.ldexp(np.rint(np.ldexp(mantissa, TOLD_DIGITS)), power - TOLD_DIGITS)
        shares = np.rint(np.ldexp(self.shares, TOLD_DIGITS))
        return Proposal(shares / shares.sum(), np.rint(self.means / grid) * grid, roots)

    def draw(self, uniform: FloatArray, normal: FloatArray, chi_square: FloatArray) -> FloatArray:
        """(S, P) draws from uniform (S,), standard normal (S, P) and chi-square (S,) variates."""
        which = np.minimum(np.searchsorted(np.cumsum(self.shares), uniform), len(self.shares) - 1)
        scaled = np.einsum("sij,sj->si", self.roots[which], normal)
        return np.asarray(self.means[which] + scaled * np.sqrt(DEGREES / chi_square)[:, None])

    def log_density(self, theta: FloatArray) -> FloatArray:
        """(S,) normalised log densities."""
        parts = self._log_parts(theta)
        top = parts.max(axis=0)
        return np.asarray(top + np.log(np.exp(parts - top).sum(axis=0)))

    def _log_parts(self, theta: FloatArray) -> FloatArray:
        """(C, S) log of each component's share of the density."""
        count = self.means.shape[1]
        z = (theta[None] - self.means[:, None]) @ self._inverses.swapaxes(1, 2)
        square = np.einsum("csi,csi->cs", z, z)
        return np.asarray(self._levels[:, None] - 0.5 * (DEGREES + count) * np.log1p(square / DEGREES))

    @cached_property
    def _inverses(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self.roots))

    @cached_property
    def _levels(self) -> FloatArray:
        """(C,) log density of each share at its mean."""
        count = self.means.shape[1]
        norm = lgamma((DEGREES + count) / 2) - lgamma(DEGREES / 2) - 0.5 * count * log(DEGREES * pi)
        volumes = np.log(np.diagonal(self.roots, axis1=1, axis2=2)).sum(axis=1)
        return np.asarray(norm + np.log(np.maximum(self.shares, 1e-300)) - volumes)

    def learned(self, draws: FloatArray, weights: FloatArray) -> Proposal:
        """The mixture after one step of expectation maximisation on weighted draws (S, P).

        Reference: Cappé, Douc, Guillin, Marin & Robert, "Adaptive importance sampling in general mixture classes",
        Statistics and Computing 18 (2008), section 4.2.
        """
        parts = self._log_parts(draws)
        belongs = np.exp(parts - parts.max(axis=0))
        belongs = belongs / belongs.sum(axis=0) * weights
        count = draws.shape[1]
        shares, means, roots = np.empty_like(self.shares), self.means.copy(), self.roots.copy()
        for c in range(len(shares)):
            shares[c] = belongs[c].sum()
            if shares[c] < LEAST_SHARE:
                continue
            square = (((draws - self.means[c]) @ self._inverses[c].T) ** 2).sum(axis=1)
            pull = belongs[c] * (DEGREES + count) / (DEGREES + square)
            means[c] = pull @ draws / pull.sum()
            spread = draws - means[c]
            scatter = (spread * pull[:, None]).T @ spread / shares[c]
            # A component seen by few draws keeps part of its old width: it must not collapse onto them.
            seen = belongs[c] / shares[c]
            trust = 1.0 / (1.0 + 3.0 * count * float(seen @ seen))
            roots[c] = root_of(trust * scatter + (1.0 - trust) * self.roots[c] @ self.roots[c].T)
        shares = np.maximum(shares, LEAST_SHARE)
        return Proposal(shares / shares.sum(), means, roots).rounded()


def root_of(covariance: FloatArray) -> FloatArray:
    """Cholesky factor (P, P); directions without spread get a trace of it, in each parameter's own unit."""
    sd = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    correlation = covariance / np.outer(sd, sd)
    values, vectors = np.linalg.eigh(0.5 * (correlation + correlation.T))
    sound = (vectors * np.maximum(values, 1e-9)) @ vectors.T
    return np.asarray(sd[:, None] * np.linalg.cholesky(sound))
