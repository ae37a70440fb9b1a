"""The estimated surface: the envelope of the balls, and what it may claim."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.estimate.envelope.bent_lines import refuted_by_lines as refuted_by_lines
    from mapping.estimate.envelope.envelope import estimate_surface as estimate_surface
    from mapping.estimate.envelope.estimate import Estimate as Estimate
    from mapping.estimate.envelope.profile_envelope import envelope_heights as envelope_heights
    from mapping.estimate.envelope.refuted_tip import RefutedTip as RefutedTip, refuted_tip as refuted_tip
    from mapping.estimate.envelope.sweep_mesh import sweep_faces as sweep_faces
    from mapping.estimate.envelope.wrong_side import WrongSide as WrongSide, wrong_side as wrong_side

_PUBLIC = {
    "bent_lines": ("refuted_by_lines",),
    "envelope": ("estimate_surface",),
    "estimate": ("Estimate",),
    "profile_envelope": ("envelope_heights",),
    "refuted_tip": ("RefutedTip", "refuted_tip"),
    "sweep_mesh": ("sweep_faces",),
    "wrong_side": ("WrongSide", "wrong_side"),
}
doorway(__name__, _PUBLIC)
