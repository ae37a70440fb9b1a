"""Posterior: draws of a feature's parameters, and how far they can be trusted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mapping.arrays import FloatArray

# Panels of a plot that stand beside one another
PANELS_BESIDE = 4
PLOT_TICKS = 3
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

    @property
    def trusted(self) -> bool:
        """True where its draws stand for the posterior; else `reason` says what hinders."""
        return self.status in ("converged", "not needed")

    def plot(self, figure: Any = None) -> Any:
        """Draw a histogram of each parameter's draws, with its median and central 90 %.

        Args:
            figure: of matplotlib, to draw into; None: a new one.

        Returns:
            The figure.
        """
        count = len(self.names)
        if figure is None:
            import matplotlib.pyplot as plt

            figure = plt.figure(figsize=(2.4 * min(count, PANELS_BESIDE), 2.0 * -(-count // PANELS_BESIDE)))
            figure.set_layout_engine("constrained")
        panels = figure.subplots(-(-count // PANELS_BESIDE), min(count, PANELS_BESIDE), squeeze=False).ravel()
        for axes, name, unit, values in zip(panels, self.names, self.units, self.samples.T, strict=False):
            # lengths in the unit that their range reads well in, and few ticks: long numbers ran into one another
            factor, unit = _plotted_unit(values) if unit == "m" else (1.0, unit)
            draws = values / factor
            low, median, high = np.quantile(draws, [0.05, 0.5, 0.95])
            axes.axvspan(low, high, color="#b91c1c", alpha=0.15)
            axes.hist(draws, bins="auto", histtype="step", color="#1f2933")
            axes.axvline(median, color="#b91c1c")
            axes.set_xlabel(f"{name} ({unit})" if unit else name)
            axes.set_yticks([])
            axes.locator_params(axis="x", nbins=PLOT_TICKS)
            axes.ticklabel_format(axis="x", useOffset=False)
        for axes in panels[count:]:
            axes.remove()
        return figure

    def draws(self, name: str) -> FloatArray:
        """(S,) draws of one parameter; KeyError names the possible ones."""
        if name not in self.names:
            raise KeyError(f"posterior has no parameter {name!r}; it has {', '.join(self.names)}")
        return np.asarray(self.samples[:, self.names.index(name)])


def _plotted_unit(values: FloatArray) -> tuple[float, str]:
    """The unit of length (m, name) in which draws of a length are drawn: micrometres next to zero, else millimetres."""
    largest = float(np.abs(values).max(initial=0.0))
    return (1e-6, "µm") if largest < 1e-4 else (1e-3, "mm")
