"""Posterior: draws of a feature's parameters, and how far they can be trusted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping.arrays import FloatArray

POSTERIOR_STATUSES = ("converged", "chain too short", "stuck", "not needed")


@dataclass(frozen=True, eq=False)
class Posterior:
    """Draws of P parameters.

    Args:
        names: P parameter names.
        units: P units ("m", "rad", "1/m", "").
        samples: (S, P) draws, thinned to nearly independent ones.
        tau: largest integrated autocorrelation time of the chain, steps; NaN if no chain ran.
        acceptance: acceptance fraction of the chain; NaN if no chain ran.
        status: one of POSTERIOR_STATUSES; "not needed" means that Laplace with importance sampling sufficed.
        reason: one sentence saying why the status is what it is.
        k_hat: Pareto shape of the importance weights of the Laplace approximation, NaN if not computed.
        ess: effective number of independent draws behind `samples`.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    samples: FloatArray
    tau: float
    acceptance: float
    status: str
    reason: str = ""
    k_hat: float = float("nan")
    ess: float = float("nan")

    def draws(self, name: str) -> FloatArray:
        """(S,) draws of one parameter; KeyError names the possible ones."""
        if name not in self.names:
            raise KeyError(f"posterior has no parameter {name!r}; it has {', '.join(self.names)}")
        return np.asarray(self.samples[:, self.names.index(name)])
