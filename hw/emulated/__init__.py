"""Emulated machines on a pseudo-terminal: what the drivers are tested against."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from hw.emulated.force import (
        SENSOR_FAULTS as SENSOR_FAULTS,
        ForceEmulator as ForceEmulator,
        LineSensorEmulator as LineSensorEmulator,
        OptoForceEmulator as OptoForceEmulator,
    )
    from hw.emulated.grbl import GrblEmulator as GrblEmulator
    from hw.emulated.pty_server import PtyServer as PtyServer
    from hw.emulated.stage import PROBE_FAULTS as PROBE_FAULTS
    from hw.emulated.touched_body import TouchedBody as TouchedBody
    from hw.emulated.wire import Wire as Wire

_PUBLIC = {
    "force": ("ForceEmulator", "LineSensorEmulator", "OptoForceEmulator", "SENSOR_FAULTS"),
    "grbl": ("GrblEmulator",),
    "stage": ("PROBE_FAULTS",),
    "pty_server": ("PtyServer",),
    "touched_body": ("TouchedBody",),
    "wire": ("Wire",),
}
doorway(__name__, _PUBLIC)
