"""The one place that imports emcee for a run: without scipy.stats, which one of its moves alone would use."""

from __future__ import annotations

import sys
from functools import cache
from typing import Any

STATISTICS = "scipy.stats"


@cache
def emcee() -> Any:
    """The emcee module.

    Its move by kernel densities, which nothing here uses, imports scipy.stats: three quarters of what importing emcee
    costs. That move loads it when it is first used.
    """
    if STATISTICS in sys.modules:
        import emcee as module

        return module
    sys.modules[STATISTICS] = None  # type: ignore[assignment]  # an import of it fails, which emcee provides for
    try:
        import emcee as module
    finally:
        del sys.modules[STATISTICS]
    module.moves.kde.gaussian_kde = _gaussian_kde
    return module


def _gaussian_kde(*args: Any, **settings: Any) -> Any:
    """scipy's kernel density estimate, loaded when it is called."""
    from scipy.stats import gaussian_kde

    return gaussian_kde(*args, **settings)
