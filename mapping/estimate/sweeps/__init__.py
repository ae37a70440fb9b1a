"""Sweeps as rows of samples: tangents, kinks, normals, smoothing, labels."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.estimate.sweeps.contact_row import (
        ContactRow as ContactRow,
        contact_row as contact_row,
        in_plane as in_plane,
    )
    from mapping.estimate.sweeps.curvature import (
        CurvatureFeature as CurvatureFeature,
        curvature_along as curvature_along,
        features_beyond as features_beyond,
        half_width_for as half_width_for,
        joined as joined,
    )
    from mapping.estimate.sweeps.labels import (
        BRIDGED as BRIDGED,
        EXTRAPOLATED as EXTRAPOLATED,
        LABELS as LABELS,
        TOUCHED as TOUCHED,
    )
    from mapping.estimate.sweeps.normals import SurfaceNormals as SurfaceNormals, at_kinks as at_kinks
    from mapping.estimate.sweeps.rows import parallel_rows as parallel_rows, pitch as pitch, thinned as thinned
    from mapping.estimate.sweeps.smoothing import Directions as Directions, Smoothed as Smoothed, smooth as smooth
    from mapping.estimate.sweeps.tangents import unit as unit

_PUBLIC = {
    "contact_row": ("ContactRow", "contact_row", "in_plane"),
    "curvature": ("CurvatureFeature", "curvature_along", "features_beyond", "half_width_for", "joined"),
    "labels": ("BRIDGED", "EXTRAPOLATED", "LABELS", "TOUCHED"),
    "normals": ("SurfaceNormals", "at_kinks"),
    "rows": ("parallel_rows", "pitch", "thinned"),
    "smoothing": ("Directions", "Smoothed", "smooth"),
    "tangents": ("unit",),
}
doorway(__name__, _PUBLIC)
