"""Families of shapes: what a feature's trace looks like, with the parameters to be found."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.inference.families.bell import (
        BellRidgeShape as BellRidgeShape,
        BellShape as BellShape,
        bell_beside as bell_beside,
        bell_ridge_beside as bell_ridge_beside,
        bell_section as bell_section,
        bell_widths as bell_widths,
        width_at_half_height as width_at_half_height,
    )
    from mapping.inference.families.broken_ridge import BrokenRidgeShape as BrokenRidgeShape
    from mapping.inference.families.bump import BumpShape as BumpShape, Spot as Spot, spot_at as spot_at
    from mapping.inference.families.free_tip import with_free_tip as with_free_tip, with_nominal_tip as with_nominal_tip
    from mapping.inference.families.groove import Crossing as Crossing, GrooveShape as GrooveShape
    from mapping.inference.families.line_ends import tells_of_line as tells_of_line
    from mapping.inference.families.nodes import LineShape as LineShape
    from mapping.inference.families.pit import PitShape as PitShape
    from mapping.inference.families.problem import (
        MEETING_REACH as MEETING_REACH,
        MODEL_FLOOR as MODEL_FLOOR,
        PRECISE as PRECISE,
        PosteriorProblem as PosteriorProblem,
        Sizes as Sizes,
        Surroundings as Surroundings,
        touches as touches,
        window_for as window_for,
        window_of_all as window_of_all,
        window_reach as window_reach,
    )
    from mapping.inference.families.ridge import RidgeShape as RidgeShape, rounding_of as rounding_of
    from mapping.inference.families.smooth_hollow import (
        SmoothGrooveShape as SmoothGrooveShape,
        SmoothPitShape as SmoothPitShape,
        smooth_beginnings as smooth_beginnings,
        smooth_groove_beside as smooth_groove_beside,
        smooth_pit_beside as smooth_pit_beside,
        smooth_section as smooth_section,
    )
    from mapping.inference.families.step import (
        OffsetRims as OffsetRims,
        StepShape as StepShape,
        slanted_beginnings as slanted_beginnings,
        slanted_beside as slanted_beside,
    )
    from mapping.inference.families.trapezoid import (
        FlatTopped as FlatTopped,
        FrustumShape as FrustumShape,
        RoundedFrustumShape as RoundedFrustumShape,
        ShoulderedShape as ShoulderedShape,
        TrapezoidShape as TrapezoidShape,
        flat_topped_widths as flat_topped_widths,
        frustum_beside as frustum_beside,
        rounded_frustum_beside as rounded_frustum_beside,
        shouldered_beside as shouldered_beside,
        shouldered_widths as shouldered_widths,
        touched_widths as touched_widths,
        trapezoid_beside as trapezoid_beside,
    )
    from mapping.inference.families.twin import TwinShape as TwinShape, twin_beside as twin_beside
    from mapping.inference.families.worn_tip import WornTipShape as WornTipShape, with_worn_tip as with_worn_tip

_PUBLIC = {
    "bell": (
        "BellRidgeShape",
        "BellShape",
        "bell_beside",
        "bell_ridge_beside",
        "bell_section",
        "bell_widths",
        "width_at_half_height",
    ),
    "broken_ridge": ("BrokenRidgeShape",),
    "bump": ("BumpShape", "Spot", "spot_at"),
    "free_tip": ("with_free_tip", "with_nominal_tip"),
    "groove": ("Crossing", "GrooveShape"),
    "line_ends": ("tells_of_line",),
    "nodes": ("LineShape",),
    "pit": ("PitShape",),
    "problem": (
        "MEETING_REACH",
        "MODEL_FLOOR",
        "PRECISE",
        "PosteriorProblem",
        "Sizes",
        "Surroundings",
        "touches",
        "window_for",
        "window_of_all",
        "window_reach",
    ),
    "ridge": ("RidgeShape", "rounding_of"),
    "smooth_hollow": (
        "SmoothGrooveShape",
        "SmoothPitShape",
        "smooth_beginnings",
        "smooth_groove_beside",
        "smooth_pit_beside",
        "smooth_section",
    ),
    "step": ("OffsetRims", "StepShape", "slanted_beginnings", "slanted_beside"),
    "trapezoid": (
        "FlatTopped",
        "FrustumShape",
        "RoundedFrustumShape",
        "ShoulderedShape",
        "TrapezoidShape",
        "flat_topped_widths",
        "frustum_beside",
        "rounded_frustum_beside",
        "shouldered_beside",
        "shouldered_widths",
        "touched_widths",
        "trapezoid_beside",
    ),
    "twin": ("TwinShape", "twin_beside"),
    "worn_tip": ("WornTipShape", "with_worn_tip"),
}
doorway(__name__, _PUBLIC)
