"""Templates: the closed-form traces of caps, chains, hollows and bells."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.geometry.templates.bell_kernels import bell_heights as bell_heights
    from mapping.geometry.templates.bump_of_revolution import BumpOfRevolution as BumpOfRevolution
    from mapping.geometry.templates.cap_section import radius_of_cap as radius_of_cap, width_of_cap as width_of_cap
    from mapping.geometry.templates.chain_kernels import chain_heights as chain_heights
    from mapping.geometry.templates.crossing_kernels import crossing_heights as crossing_heights
    from mapping.geometry.templates.hollow_kernels import (
        groove_heights as groove_heights,
        pit_heights as pit_heights,
        step_heights as step_heights,
    )
    from mapping.geometry.templates.mouth_kernels import mouth_heights as mouth_heights
    from mapping.geometry.templates.outlines import (
        flat_outline as flat_outline,
        round_outline as round_outline,
        shouldered_outline as shouldered_outline,
        smooth_outline as smooth_outline,
        upright_outline as upright_outline,
    )
    from mapping.geometry.templates.section_kernels import section_heights as section_heights
    from mapping.geometry.templates.shapes import (
        cap_height as cap_height,
        chain_height as chain_height,
        contact_half_width as contact_half_width,
        groove_height as groove_height,
        kink_angle as kink_angle,
        rim_height as rim_height,
        step_height as step_height,
        untouched_run as untouched_run,
    )
    from mapping.geometry.templates.small_heights import (
        CREST_OUTLIER_SDS as CREST_OUTLIER_SDS,
        SHAPE_ERROR as SHAPE_ERROR,
        crest_trace as crest_trace,
        robust_cost as robust_cost,
    )
    from mapping.geometry.templates.smooth_kernels import (
        half_ways_touched as half_ways_touched,
        smooth_line_heights as smooth_line_heights,
        smooth_point_heights as smooth_point_heights,
    )

_PUBLIC = {
    "bell_kernels": ("bell_heights",),
    "bump_of_revolution": ("BumpOfRevolution",),
    "cap_section": ("radius_of_cap", "width_of_cap"),
    "chain_kernels": ("chain_heights",),
    "crossing_kernels": ("crossing_heights",),
    "hollow_kernels": ("groove_heights", "pit_heights", "step_heights"),
    "mouth_kernels": ("mouth_heights",),
    "outlines": ("flat_outline", "round_outline", "shouldered_outline", "smooth_outline", "upright_outline"),
    "section_kernels": ("section_heights",),
    "shapes": (
        "cap_height",
        "chain_height",
        "contact_half_width",
        "groove_height",
        "kink_angle",
        "rim_height",
        "step_height",
        "untouched_run",
    ),
    "small_heights": ("CREST_OUTLIER_SDS", "SHAPE_ERROR", "crest_trace", "robust_cost"),
    "smooth_kernels": ("half_ways_touched", "smooth_line_heights", "smooth_point_heights"),
}
doorway(__name__, _PUBLIC)
