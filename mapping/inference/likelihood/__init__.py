"""The likelihood of the samples near a feature: windows, whitening, priors, density."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.inference.likelihood.beside import Beside as Beside
    from mapping.inference.likelihood.bin_filter import bin_filter as bin_filter
    from mapping.inference.likelihood.gaussian import (
        Likelihood as Likelihood,
        Nuisance as Nuisance,
        build_likelihood as build_likelihood,
    )
    from mapping.inference.likelihood.priors import (
        LogOfUniform as LogOfUniform,
        Normal as Normal,
        Prior as Prior,
        StudentT as StudentT,
        Uniform as Uniform,
    )
    from mapping.inference.likelihood.target import LogPosterior as LogPosterior, Shape as Shape
    from mapping.inference.likelihood.window import (
        Window as Window,
        bin_samples as bin_samples,
        distance_along as distance_along,
        gather as gather,
        samples_near as samples_near,
    )

_PUBLIC = {
    "beside": ("Beside",),
    "bin_filter": ("bin_filter",),
    "gaussian": ("Likelihood", "Nuisance", "build_likelihood"),
    "priors": ("LogOfUniform", "Normal", "Prior", "StudentT", "Uniform"),
    "target": ("LogPosterior", "Shape"),
    "window": ("Window", "bin_samples", "distance_along", "gather", "samples_near"),
}
doorway(__name__, _PUBLIC)
