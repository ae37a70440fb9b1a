"""Jobs: run, analyze, plan, merge, and what serves them."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.jobs.analyze import (
        Told as Told,
        analyze as analyze,
        analyze_each as analyze_each,
        log_path as log_path,
    )
    from explore3d.jobs.compare import Compared as Compared, compare as compare, watched as watched
    from explore3d.jobs.expedition import (
        Explored as Explored,
        Explorer as Explorer,
        Waits as Waits,
        explorer as explorer,
        foretold_survey as foretold_survey,
    )
    from explore3d.jobs.merge import load as load, merge as merge
    from explore3d.jobs.plan import plan_into as plan_into, plan_scene as plan_scene
    from explore3d.jobs.resume import Execute as Execute, Replay as Replay
    from explore3d.jobs.run import cause as cause, open_scene as open_scene, run as run, scene_finger as scene_finger
    from explore3d.jobs.session import (
        MARKER as MARKER,
        belongs_to_session as belongs_to_session,
        locked as locked,
        undisturbed as undisturbed,
    )

_PUBLIC = {
    "analyze": ("Told", "analyze", "analyze_each", "log_path"),
    "compare": ("Compared", "compare", "watched"),
    "expedition": ("Explored", "Explorer", "Waits", "explorer", "foretold_survey"),
    "merge": ("load", "merge"),
    "plan": ("plan_into", "plan_scene"),
    "resume": ("Execute", "Replay"),
    "run": ("cause", "open_scene", "run", "scene_finger"),
    "session": ("MARKER", "belongs_to_session", "locked", "undisturbed"),
}
doorway(__name__, _PUBLIC)
