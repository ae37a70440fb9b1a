"""The instrument: the noise of a sweep, its fit, its statement, robust measures of it, and the tip's calibration."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.instrument.averaging import (
        Means as Means,
        RunMeans as RunMeans,
        running_mean as running_mean,
        running_means as running_means,
    )
    from mapping.instrument.averaging_kernels import at_middles as at_middles
    from mapping.instrument.block_likelihood import (
        Blocks as Blocks,
        NoiseFit as NoiseFit,
        perturbed as perturbed,
        relative_sd as relative_sd,
    )
    from mapping.instrument.core import core_of as core_of, fit_on_densest as fit_on_densest, span_of as span_of
    from mapping.instrument.levels import Levels as Levels
    from mapping.instrument.noise import (
        CONTACT_ROUNDING as CONTACT_ROUNDING,
        Noise as Noise,
        estimate_noise as estimate_noise,
        least_noise as least_noise,
    )
    from mapping.instrument.noise_fit import fit_noise as fit_noise
    from mapping.instrument.robust import (
        BISQUARE as BISQUARE,
        FEATURE_RESIDUAL_SDS as FEATURE_RESIDUAL_SDS,
        MAD_TO_SD as MAD_TO_SD,
        RobustFit as RobustFit,
        neighbour_scatter as neighbour_scatter,
        robust_fit as robust_fit,
        robust_scale as robust_scale,
        robust_sd as robust_sd,
    )
    from mapping.instrument.stated import StatedNoise as StatedNoise
    from mapping.instrument.states import Filter as Filter, mean_steps as mean_steps
    from mapping.instrument.term import Term as Term
    from mapping.instrument.tip_calibration import TipCalibration as TipCalibration, calibrate_tip as calibrate_tip
    from mapping.instrument.unshared_heights import ROWS_THAT_SHARE as ROWS_THAT_SHARE, Row as Row, unshared as unshared

_PUBLIC = {
    "averaging": ("Means", "RunMeans", "running_mean", "running_means"),
    "averaging_kernels": ("at_middles",),
    "block_likelihood": ("Blocks", "NoiseFit", "perturbed", "relative_sd"),
    "core": ("core_of", "fit_on_densest", "span_of"),
    "levels": ("Levels",),
    "noise_fit": ("fit_noise",),
    "noise": ("CONTACT_ROUNDING", "Noise", "estimate_noise", "least_noise"),
    "robust": (
        "BISQUARE",
        "FEATURE_RESIDUAL_SDS",
        "MAD_TO_SD",
        "RobustFit",
        "neighbour_scatter",
        "robust_fit",
        "robust_scale",
        "robust_sd",
    ),
    "stated": ("StatedNoise",),
    "states": ("Filter", "mean_steps"),
    "term": ("Term",),
    "tip_calibration": ("TipCalibration", "calibrate_tip"),
    "unshared_heights": ("ROWS_THAT_SHARE", "Row", "unshared"),
}
doorway(__name__, _PUBLIC)
