"""What physically touches: a Move, and fingers that execute it and return a Trace."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from hw.errors import (
        FingerError as FingerError,
        GcodeError as GcodeError,
        LinkError as LinkError,
        MoveError as MoveError,
        NotFeltError as NotFeltError,
        StoppedError as StoppedError,
        UntrueForceError as UntrueForceError,
    )
    from hw.felt import wrong_trace as wrong_trace
    from hw.finger import Finger as Finger, Workspace as Workspace
    from hw.framing import Frames as Frames, Framing as Framing, Lines as Lines
    from hw.link import Link as Link
    from hw.move import THROUGH_SPACE as THROUGH_SPACE, Move as Move
    from hw.patience import Patience as Patience
    from hw.safety import (
        SIGNALS as SIGNALS,
        StopIfKilled as StopIfKilled,
        StopOnSignal as StopOnSignal,
        end_program as end_program,
    )
    from hw.simulated.finger import SimulatedFinger as SimulatedFinger

_PUBLIC = {
    "errors": (
        "FingerError",
        "GcodeError",
        "LinkError",
        "MoveError",
        "NotFeltError",
        "StoppedError",
        "UntrueForceError",
    ),
    "felt": ("wrong_trace",),
    "finger": ("Finger", "Workspace"),
    "framing": ("Frames", "Framing", "Lines"),
    "link": ("Link",),
    "move": ("THROUGH_SPACE", "Move"),
    "patience": ("Patience",),
    "safety": ("SIGNALS", "StopIfKilled", "StopOnSignal", "end_program"),
    "simulated.finger": ("SimulatedFinger",),
}
doorway(__name__, _PUBLIC)
