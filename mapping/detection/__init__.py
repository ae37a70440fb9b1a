"""Detection: the crossings of one sweep, at a stated rate of false alarms."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.detection.candidates import CLEAR as CLEAR
    from mapping.detection.coverage import (
        Coverage as Coverage,
        FoundHeights as FoundHeights,
        coverage as coverage,
        face_samples as face_samples,
        found_heights as found_heights,
        in_cells as in_cells,
        lost_heights as lost_heights,
    )
    from mapping.detection.crossing import Crossing as Crossing
    from mapping.detection.detect import (
        LARGEST as LARGEST,
        SHORTEST_SWEEP_SAMPLES as SHORTEST_SWEEP_SAMPLES,
        Detections as Detections,
        detect as detect,
        expected_limit as expected_limit,
    )
    from mapping.detection.filters.groove_limit import (
        DIP as DIP,
        crest_like_groove as crest_like_groove,
        groove_dip as groove_dip,
        narrowest_groove as narrowest_groove,
    )
    from mapping.detection.filters.matched_filter import LADDER as LADDER
    from mapping.detection.outliers import LONGEST_RUN as LONGEST_RUN
    from mapping.detection.paper_algorithms import (
        along_chord as along_chord,
        curvature_features as curvature_features,
        curvature_profile as curvature_profile,
    )
    from mapping.detection.quiet_noise import RAW_SAMPLES as RAW_SAMPLES, smallest_crest as smallest_crest
    from mapping.detection.recovery import recovered as recovered
    from mapping.detection.terraces import terraced as terraced

_PUBLIC = {
    "candidates": ("CLEAR",),
    "coverage": (
        "Coverage",
        "FoundHeights",
        "coverage",
        "face_samples",
        "found_heights",
        "in_cells",
        "lost_heights",
    ),
    "crossing": ("Crossing",),
    "detect": ("LARGEST", "SHORTEST_SWEEP_SAMPLES", "Detections", "detect", "expected_limit"),
    "filters.matched_filter": ("LADDER",),
    "filters.groove_limit": ("DIP", "crest_like_groove", "groove_dip", "narrowest_groove"),
    "outliers": ("LONGEST_RUN",),
    "paper_algorithms": ("along_chord", "curvature_features", "curvature_profile"),
    "quiet_noise": ("RAW_SAMPLES", "smallest_crest"),
    "recovery": ("recovered",),
    "terraces": ("terraced",),
}
doorway(__name__, _PUBLIC)
