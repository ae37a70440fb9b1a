"""Assembly: crossings become features."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.assembly.along_sweeps import (
        RUNS_ALONG as RUNS_ALONG,
        AlongSweeps as AlongSweeps,
        along_sweeps as along_sweeps,
    )
    from mapping.assembly.assemble import (
        assemble as assemble,
        half_felt as half_felt,
        inspected_for as inspected_for,
        place_spacing as place_spacing,
    )
    from mapping.assembly.faint_features import why_none_sought as why_none_sought, with_faint_lines as with_faint_lines
    from mapping.assembly.faint_lines import load_faint_kernel as load_faint_kernel
    from mapping.assembly.free.felt_alone import felt_alone as felt_alone
    from mapping.assembly.free.free_sections import without_wide as without_wide
    from mapping.assembly.linking.inspection import Inspections as Inspections

_PUBLIC = {
    "along_sweeps": ("RUNS_ALONG", "AlongSweeps", "along_sweeps"),
    "assemble": ("assemble", "half_felt", "inspected_for", "place_spacing"),
    "faint_features": ("why_none_sought", "with_faint_lines"),
    "faint_lines": ("load_faint_kernel",),
    "free.felt_alone": ("felt_alone",),
    "free.free_sections": ("without_wide",),
    "linking.inspection": ("Inspections",),
}
doorway(__name__, _PUBLIC)
