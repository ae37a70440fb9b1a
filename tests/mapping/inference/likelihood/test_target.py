"""The density of one shape's parameters: what searches minimise, and what they are asked for."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mapping.inference.likelihood import LogPosterior, Uniform
from mapping.inference.likelihood.priors import LogOfUniform, Normal, StudentT


class TwoHeights:
    """A likelihood whose residuals are the heights themselves."""

    window = range(2)

    def residuals(self, templates: Any) -> Any:
        return templates

    def log_density(self, templates: Any) -> Any:
        return -0.5 * (templates**2).sum(axis=1)


def test_chi_square_goes_with_the_log_density_whatever_the_priors() -> None:
    priors = (Uniform(-2.0, 3.0), LogOfUniform(-1.0, 2.0), Normal(0.3, 0.5), StudentT(0.0, 0.2))
    shape: Any = SimpleNamespace(priors=priors, templates=lambda theta: theta[:, :2] + theta[:, 2:])
    likelihood: Any = TwoHeights()
    target = LogPosterior(shape, likelihood)
    for theta in ([0.5, 0.1, 0.2, -0.4], [-1.9, 1.9, 2.0, 0.0]):
        square = float((target.residuals(np.array(theta)) ** 2).sum())
        assert target.chi_square(float(target.log_density(np.array(theta))[0])) == pytest.approx(square)
