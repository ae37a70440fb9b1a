"""A stage under a Grbl controller: protocol, frame, guarded motion."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from hw.grbl.controller import GrblController as GrblController, Report as Report
    from hw.grbl.expected import ExpectedSurface as ExpectedSurface
    from hw.grbl.frame import StageFrame as StageFrame
    from hw.grbl.guarded_stage import LONGEST_STANDSTILL as LONGEST_STANDSTILL, GuardedStage as GuardedStage
    from hw.grbl.protocol import RECEIVE_BUFFER as RECEIVE_BUFFER

_PUBLIC = {
    "controller": ("GrblController", "Report"),
    "expected": ("ExpectedSurface",),
    "frame": ("StageFrame",),
    "guarded_stage": ("GuardedStage", "LONGEST_STANDSTILL"),
    "protocol": ("RECEIVE_BUFFER",),
}
doorway(__name__, _PUBLIC)
