"""The application: scenes, logs, runs, reports, command line; and the front door of the whole.

import explore3d

analysis = explore3d.run("scene.toml", "out/wire")
model = explore3d.load("out/wire")
model["ridge-1"].height
"""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.errors import (
        EmptyLogError as EmptyLogError,
        FolderError as FolderError,
        MeshFileError as MeshFileError,
        PointCloudError as PointCloudError,
        SceneError as SceneError,
        UnitError as UnitError,
        UserError as UserError,
    )
    from explore3d.jobs.analyze import analyze as analyze
    from explore3d.jobs.compare import compare as compare
    from explore3d.jobs.merge import load as load, merge as merge
    from explore3d.jobs.run import run as run
    from explore3d.scene.scene import Scene as Scene, load_scene as load_scene
    from explore3d.scene.units import (
        UNITS as UNITS,
        count_text as count_text,
        parse_angle as parse_angle,
        parse_force as parse_force,
        parse_length as parse_length,
        parse_rate as parse_rate,
        parse_speed as parse_speed,
        parse_time as parse_time,
        seconds_text as seconds_text,
        unit_factor as unit_factor,
    )
    from explore3d.version import __version__ as __version__

_PUBLIC = {
    "errors": (
        "EmptyLogError",
        "FolderError",
        "MeshFileError",
        "PointCloudError",
        "SceneError",
        "UnitError",
        "UserError",
    ),
    "jobs.analyze": ("analyze",),
    "jobs.compare": ("compare",),
    "jobs.merge": ("load", "merge"),
    "jobs.run": ("run",),
    "scene.scene": ("Scene", "load_scene"),
    "scene.units": (
        "UNITS",
        "count_text",
        "parse_angle",
        "parse_force",
        "parse_length",
        "parse_rate",
        "parse_speed",
        "parse_time",
        "seconds_text",
        "unit_factor",
    ),
    "version": ("__version__",),
}
doorway(__name__, _PUBLIC)
