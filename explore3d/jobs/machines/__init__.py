"""Machines: calibrating a real tip, asking a place again, and the machine that is emulated beside a run."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.jobs.machines.calibrate import (
        Recording as Recording,
        as_json as as_json,
        calibrate as calibrate,
        selftest as selftest,
        write_profile as write_profile,
    )
    from explore3d.jobs.machines.emulate import Emulation as Emulation, serve as serve
    from explore3d.jobs.machines.machine_finger import GrblFingerTable as GrblFingerTable
    from explore3d.jobs.machines.reprobe import reprobe as reprobe

_PUBLIC = {
    "calibrate": ("Recording", "as_json", "calibrate", "selftest", "write_profile"),
    "emulate": ("Emulation", "serve"),
    "machine_finger": ("GrblFingerTable",),
    "reprobe": ("reprobe",),
}
doorway(__name__, _PUBLIC)
