"""The instrument: the noise of a sweep, its fit, its statement, robust measures of it, and the tip's calibration."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.instrument.averaging import Means as Means, RunMeans as RunMeans, running_mean as running_mean
    from mapping.instrument.fit import (
        Blocks as Blocks,
        NoiseFit as NoiseFit,
        fit_noise as fit_noise,
        perturbed as perturbed,
        relative_sd as relative_sd,
    )
    from mapping.instrument.noise import Noise as Noise, estimate_noise as estimate_noise
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
    from mapping.instrument.tip_calibration import TipCalibration as TipCalibration, calibrate_tip as calibrate_tip

_PUBLIC = {
    "averaging": ("Means", "RunMeans", "running_mean"),
    "fit": ("Blocks", "NoiseFit", "fit_noise", "perturbed", "relative_sd"),
    "noise": ("Noise", "estimate_noise"),
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
    "tip_calibration": ("TipCalibration", "calibrate_tip"),
}
doorway(__name__, _PUBLIC)
