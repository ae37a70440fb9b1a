"""Jobs: run, analyze, plan, merge, and what serves them."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.jobs.analyze import analyze as analyze, analyze_each as analyze_each
    from explore3d.jobs.calibrate import (
        Recording as Recording,
        as_json as as_json,
        calibrate as calibrate,
        selftest as selftest,
        write_profile as write_profile,
    )
    from explore3d.jobs.emulate import Emulation as Emulation, serve as serve
    from explore3d.jobs.expedition import Explored as Explored, Explorer as Explorer, explorer as explorer
    from explore3d.jobs.machine_finger import GrblFingerTable as GrblFingerTable
    from explore3d.jobs.merge import load as load, merge as merge
    from explore3d.jobs.plan import plan_scene as plan_scene, show_plan as show_plan
    from explore3d.jobs.reprobe import reprobe as reprobe
    from explore3d.jobs.run import cause as cause, open_scene as open_scene, run as run, scene_finger as scene_finger

_PUBLIC = {
    "analyze": ("analyze", "analyze_each"),
    "calibrate": ("Recording", "as_json", "calibrate", "selftest", "write_profile"),
    "emulate": ("Emulation", "serve"),
    "expedition": ("Explored", "Explorer", "explorer"),
    "machine_finger": ("GrblFingerTable",),
    "merge": ("load", "merge"),
    "plan": ("plan_scene", "show_plan"),
    "reprobe": ("reprobe",),
    "run": ("cause", "open_scene", "run", "scene_finger"),
}
doorway(__name__, _PUBLIC)
