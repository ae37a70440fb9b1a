"""Force sensors on a serial line, and their clocks."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from hw.sensors.force_sensor import (
        FREE_AIR as FREE_AIR,
        LONGEST_SENSOR_SILENCE as LONGEST_SENSOR_SILENCE,
        ForceSensor as ForceSensor,
        FreeAir as FreeAir,
    )
    from hw.sensors.line_sensor import LineSensor as LineSensor, encode_line as encode_line
    from hw.sensors.optoforce import (
        CONFIGURE as CONFIGURE,
        RATE_CODES as RATE_CODES,
        OptoForce as OptoForce,
        checksum as checksum,
        encode_frame as encode_frame,
    )
    from hw.sensors.sample_kernels import load_sample_kernels as load_sample_kernels

_PUBLIC = {
    "force_sensor": ("FREE_AIR", "ForceSensor", "FreeAir", "LONGEST_SENSOR_SILENCE"),
    "line_sensor": ("LineSensor", "encode_line"),
    "optoforce": ("CONFIGURE", "OptoForce", "RATE_CODES", "checksum", "encode_frame"),
    "sample_kernels": ("load_sample_kernels",),
}
doorway(__name__, _PUBLIC)
