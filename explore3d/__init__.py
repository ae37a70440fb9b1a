"""The application: scenes, logs, runs, reports, command line."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.errors import (
        FolderError as FolderError,
        MeshFileError as MeshFileError,
        PointCloudError as PointCloudError,
        SceneError as SceneError,
        UnitError as UnitError,
        UserError as UserError,
    )
    from explore3d.units import (
        UNITS as UNITS,
        UNKNOWN_TEXT as UNKNOWN_TEXT,
        count_text as count_text,
        interval_text as interval_text,
        length_text as length_text,
        length_unit as length_unit,
        parse_angle as parse_angle,
        parse_force as parse_force,
        parse_length as parse_length,
        parse_rate as parse_rate,
        parse_speed as parse_speed,
        parse_time as parse_time,
        seconds_text as seconds_text,
        unit_factor as unit_factor,
    )

__version__ = "0.2.0"

_PUBLIC = {
    "errors": ("FolderError", "MeshFileError", "PointCloudError", "SceneError", "UnitError", "UserError"),
    "units": (
        "UNITS",
        "UNKNOWN_TEXT",
        "count_text",
        "interval_text",
        "length_text",
        "length_unit",
        "parse_angle",
        "parse_force",
        "parse_length",
        "parse_rate",
        "parse_speed",
        "parse_time",
        "seconds_text",
        "unit_factor",
    ),
}
doorway(__name__, _PUBLIC)
