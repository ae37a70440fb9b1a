"""Force sensors on a serial line, and their clocks."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from hw.sensors.force_sensor import ForceSensor as ForceSensor, FreeAir as FreeAir
    from hw.sensors.line_sensor import LineSensor as LineSensor, encode_line as encode_line
    from hw.sensors.optoforce import (
        CONFIGURE as CONFIGURE,
        RATE_CODES as RATE_CODES,
        OptoForce as OptoForce,
        checksum as checksum,
        encode_frame as encode_frame,
    )

_PUBLIC = {
    "force_sensor": ("ForceSensor", "FreeAir"),
    "line_sensor": ("LineSensor", "encode_line"),
    "optoforce": ("CONFIGURE", "OptoForce", "RATE_CODES", "checksum", "encode_frame"),
}
doorway(__name__, _PUBLIC)
