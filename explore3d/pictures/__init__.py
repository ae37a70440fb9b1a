"""Pictures of the object, its features, their sections and posteriors."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.pictures.corner import corner_picture as corner_picture
    from explore3d.pictures.cross_section import cross_section as cross_section
    from explore3d.pictures.errors import size_picture as size_picture, time_picture as time_picture
    from explore3d.pictures.extent import extent_picture as extent_picture
    from explore3d.pictures.figure import (
        BAND as BAND,
        DPI as DPI,
        ESTIMATED as ESTIMATED,
        FAINT as FAINT,
        INK as INK,
        MUTED as MUTED,
        TRACED as TRACED,
        TRUTH as TRUTH,
        new_figure as new_figure,
        png as png,
        styled as styled,
    )
    from explore3d.pictures.maps import curvature_picture as curvature_picture, deviation_picture as deviation_picture
    from explore3d.pictures.object import object_picture as object_picture, view_directions as view_directions
    from explore3d.pictures.plan import plan_picture as plan_picture
    from explore3d.pictures.profile import (
        profile_line as profile_line,
        profile_picture as profile_picture,
        thinned as thinned,
    )
    from explore3d.pictures.section import section_picture as section_picture
    from explore3d.pictures.sweep_paths import (
        SweepPath as SweepPath,
        over_features as over_features,
        sweep_paths as sweep_paths,
    )

_PUBLIC = {
    "corner": ("corner_picture",),
    "cross_section": ("cross_section",),
    "errors": ("size_picture", "time_picture"),
    "extent": ("extent_picture",),
    "figure": ("BAND", "DPI", "ESTIMATED", "FAINT", "INK", "MUTED", "TRACED", "TRUTH", "new_figure", "png", "styled"),
    "maps": ("curvature_picture", "deviation_picture"),
    "object": ("object_picture", "view_directions"),
    "plan": ("plan_picture",),
    "profile": ("profile_line", "profile_picture", "thinned"),
    "section": ("section_picture",),
    "sweep_paths": ("SweepPath", "over_features", "sweep_paths"),
}
doorway(__name__, _PUBLIC)
