"""Likelihood of heights over the base: correlated noise, and a base offset, slope and bend per run marginalised."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.inference.likelihood.bin_filter import bin_filter
from mapping.inference.likelihood.window import Window
from mapping.instrument import Filter, Noise


@dataclass(frozen=True)
class Nuisance:
    """Prior standard deviations of what the base does under each run, m at the run's ends.

    Args:
        offset: of a constant height.
        slope: of a line through the run's middle, at its ends.
        bend: of a parabola, at its ends; 0 leaves it out.
    """

    offset: float
    slope: float
    bend: float = 0.0


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Gaussian likelihood of a window's heights given a template; vectorised over templates.

    Args:
        window: the bins.
        filter: whitening of the noise.
        basis: (n, Q) orthonormal whitened nuisance directions of each run.
        shrink: (runs, Q) share of each direction that the nuisance explains, 0 to 1.

    Reference: theory sections 6 and 8; linear nuisance marginalised as in Rasmussen and
    Williams, Gaussian Processes for Machine Learning, 2006, section 2.7.
    """

    window: Window
    filter: Filter
    basis: FloatArray
    shrink: FloatArray

    def log_density(self, templates: FloatArray) -> FloatArray:
        """(W,) log likelihoods of W templates (W, n), m, up to one constant of the window."""
        from mapping.inference.likelihood.whitening_kernels import chi_square

        f = self.filter
        templates = np.ascontiguousarray(templates)
        square = chi_square(
            self.window.height,
            templates,
            self.window.starts,
            f.steps.carry,
            f.steps.observe,
            f.gain,
            f.steps.turn,
            f.scale,
            self.basis,
            self.shrink,
        )
        return np.asarray(-0.5 * square)

    def residuals(self, templates: FloatArray) -> FloatArray:
        """(W, n) residuals whose squares sum to -2 log_density."""
        from mapping.inference.likelihood.whitening_kernels import project

        white = self.filter.whiten(self.window.height - templates)
        project(white, self.window.starts, self.basis, self.shrink)
        return white


def build_likelihood(
    window: Window, noise: Noise, nuisance: Nuisance, floor: float, inflation: FloatArray | None = None
) -> Likelihood:
    """The likelihood of a window under a noise; `floor` and `inflation` as in `bin_filter`."""
    whitener = bin_filter(window, noise, floor, inflation)
    sds = np.array([nuisance.offset, nuisance.slope] + ([nuisance.bend] if nuisance.bend > 0 else []))
    white = whitener.whiten(np.ascontiguousarray((_polynomials(window, len(sds)) * sds).T)).T
    basis, shrink = np.zeros_like(white), np.zeros((len(window.starts) - 1, len(sds)))
    for run, (start, stop) in enumerate(zip(window.starts[:-1], window.starts[1:], strict=True)):
        left, strength, _ = np.linalg.svd(white[start:stop], full_matrices=False)
        basis[start:stop, : left.shape[1]] = left
        shrink[run, : len(strength)] = strength**2 / (1.0 + strength**2)
    return Likelihood(window, whitener, np.ascontiguousarray(basis), shrink)


def _polynomials(window: Window, count: int) -> FloatArray:
    """(n, count) powers of the place along each run, from -1 at its beginning to 1 at its end."""
    columns = np.ones((len(window), count))
    for start, stop in zip(window.starts[:-1], window.starts[1:], strict=True):
        place = window.place[start:stop]
        reach = 0.5 * max(float(np.ptp(place)), np.finfo(float).tiny)
        columns[start:stop] = ((place - place.mean()) / reach)[:, None] ** np.arange(count)
    return columns
