"""LogPosterior: the log posterior density of one shape's parameters given a window of the trace."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from mapping import FloatArray
from mapping.geometry.mesh import by_shares
from mapping.inference.likelihood.beside import Beside
from mapping.inference.likelihood.gaussian import Likelihood
from mapping.inference.likelihood.priors import Prior


class Shape(Protocol):
    """A family of features: parameters, priors, and the trace that each member leaves on a window.

    names, units: P parameters.  priors: theirs.  start: (P,) first guess.  step: (P,) a small but visible change.
    """

    @property
    def names(self) -> tuple[str, ...]: ...

    @property
    def units(self) -> tuple[str, ...]: ...

    @property
    def priors(self) -> tuple[Prior, ...]: ...

    @property
    def start(self) -> FloatArray: ...

    @property
    def step(self) -> FloatArray: ...

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights of the trace over the base's trace for parameters (W, P), m."""
        ...


@dataclass(frozen=True, eq=False)
class LogPosterior:
    """Unnormalised log posterior, vectorised over parameter vectors.

    Args:
        shape: the family.
        likelihood: of the window's heights.
        beside: what other features near by leave there; None: nothing.
    """

    shape: Shape
    likelihood: Likelihood
    beside: Beside | None = None

    @cached_property
    def low(self) -> FloatArray:
        return np.array([prior.low for prior in self.shape.priors])

    @cached_property
    def high(self) -> FloatArray:
        return np.array([prior.high for prior in self.shape.priors])

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights of the feature together with its neighbours, m."""
        heights = self.shape.templates(theta)
        return heights if self.beside is None else self.beside.together(heights)

    @property
    def bare(self) -> FloatArray:
        """(1, n) heights without the feature, m."""
        return np.zeros((1, len(self.likelihood.window))) if self.beside is None else self.beside.alone

    def log_density(self, theta: FloatArray) -> FloatArray:
        """(W,) log posterior densities of (W, P) parameters; -inf outside the priors' support."""
        theta = np.atleast_2d(theta)
        out = np.full(len(theta), -np.inf)
        sound = ((theta >= self.low) & (theta <= self.high)).all(axis=1)
        if sound.any():
            inside = theta if sound.all() else theta[sound]
            prior = sum(p.log_density(inside[:, i]) for i, p in enumerate(self.shape.priors))
            out[sound] = prior + by_shares(self._log_likelihood, inside, len(self.likelihood.window))
        return out

    def _log_likelihood(self, theta: FloatArray) -> FloatArray:
        return self.likelihood.log_density(self.templates(theta))

    def residuals(self, theta: FloatArray) -> FloatArray:
        """(W, n + P) residuals whose squares sum to -2 log density up to a constant."""
        theta = np.clip(np.atleast_2d(theta), self.low, self.high)
        data = by_shares(self._data_residuals, theta, len(self.likelihood.window))
        prior = np.column_stack([p.residual(theta[:, i]) for i, p in enumerate(self.shape.priors)])
        return np.concatenate([data, prior], axis=1)

    def _data_residuals(self, theta: FloatArray) -> FloatArray:
        return self.likelihood.residuals(self.templates(theta))

    def with_likelihood(self, likelihood: Likelihood) -> LogPosterior:
        """The same shape under another noise; itself under its own."""
        return self if likelihood is self.likelihood else replace(self, likelihood=likelihood)
