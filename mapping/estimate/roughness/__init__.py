"""Roughness: what the surface is like beside its features, by the standards' filters and parameters."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.estimate.roughness.areal import AREAL_NAMES as AREAL_NAMES, areal_parameters as areal_parameters
    from mapping.estimate.roughness.filters import (
        NESTING_INDICES as NESTING_INDICES,
        gaussian_mean as gaussian_mean,
        suited_cutoff as suited_cutoff,
    )
    from mapping.estimate.roughness.profile import (
        PROFILE_NAMES as PROFILE_NAMES,
        Stretch as Stretch,
        profile_parameters as profile_parameters,
    )
    from mapping.estimate.roughness.section_height import (
        flat_height as flat_height,
        level_difference as level_difference,
        round_height as round_height,
        wolf_height as wolf_height,
    )
    from mapping.estimate.roughness.sections import EVALUATED_SECTIONS as EVALUATED_SECTIONS

_PUBLIC = {
    "areal": ("AREAL_NAMES", "areal_parameters"),
    "filters": ("NESTING_INDICES", "gaussian_mean", "suited_cutoff"),
    "profile": ("PROFILE_NAMES", "Stretch", "profile_parameters"),
    "section_height": ("flat_height", "round_height", "level_difference", "wolf_height"),
    "sections": ("EVALUATED_SECTIONS",),
}
doorway(__name__, _PUBLIC)
