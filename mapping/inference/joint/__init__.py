"""Joint: the posteriors of all features of a trace, each beside the others."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.inference.joint.blocks import blocks_of as blocks_of, felt_together as felt_together, gaps as gaps
    from mapping.inference.joint.joined_shape import (
        JoinedShape as JoinedShape,
        OneOfMany as OneOfMany,
        stands_out as stands_out,
    )
    from mapping.inference.joint.refinement import refine_all as refine_all

_PUBLIC = {
    "blocks": ("blocks_of", "felt_together", "gaps"),
    "joined_shape": ("JoinedShape", "OneOfMany", "stands_out"),
    "refinement": ("refine_all",),
}
doorway(__name__, _PUBLIC)
