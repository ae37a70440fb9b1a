"""Samplers of a posterior: Laplace, importance sampling, emcee's ensemble."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.inference.sampler.ensemble import (
        Chain as Chain,
        sample_ensemble as sample_ensemble,
        steps_for as steps_for,
        walkers_for as walkers_for,
    )
    from mapping.inference.sampler.importance import (
        TRUSTED_K_HAT as TRUSTED_K_HAT,
        Importance as Importance,
        importance_sample as importance_sample,
    )
    from mapping.inference.sampler.laplace import (
        ITERATIONS as ITERATIONS,
        LEARNING as LEARNING,
        Laplace as Laplace,
        find_optima as find_optima,
        laplace as laplace,
        linearised as linearised,
    )
    from mapping.inference.sampler.proposal import root_of as root_of
    from mapping.inference.sampler.psis import resample as resample

_PUBLIC = {
    "ensemble": ("Chain", "sample_ensemble", "steps_for", "walkers_for"),
    "importance": ("Importance", "TRUSTED_K_HAT", "importance_sample"),
    "laplace": ("ITERATIONS", "LEARNING", "Laplace", "find_optima", "laplace", "linearised"),
    "proposal": ("root_of",),
    "psis": ("resample",),
}
doorway(__name__, _PUBLIC)
