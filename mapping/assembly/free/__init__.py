"""Free sections: details so wide that the trace over them is their surface; measured, not fitted."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.assembly.free.felt_alone import felt_alone as felt_alone
    from mapping.assembly.free.free_sections import (
        FreeSection as FreeSection,
        free_sections as free_sections,
        free_spot as free_spot,
    )
    from mapping.assembly.free.mean_section import mean_sizes as mean_sizes
    from mapping.assembly.free.outline import WIDER_THAN_CREST as WIDER_THAN_CREST
    from mapping.assembly.free.rival_courses import outweighed as outweighed
    from mapping.assembly.free.round_lines import (
        CLEAR_SDS as CLEAR_SDS,
        round_lines as round_lines,
        uncrossed as uncrossed,
    )
    from mapping.assembly.free.section import CORE as CORE

_PUBLIC = {
    "felt_alone": ("felt_alone",),
    "free_sections": ("FreeSection", "free_sections", "free_spot"),
    "mean_section": ("mean_sizes",),
    "outline": ("WIDER_THAN_CREST",),
    "rival_courses": ("outweighed",),
    "round_lines": ("CLEAR_SDS", "round_lines", "uncrossed"),
    "section": ("CORE",),
}
doorway(__name__, _PUBLIC)
