"""Error against run time of every stage, on one page."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.bench.precision.bench import (
        as_record as as_record,
        bench as bench,
        summary as summary,
        write as write,
    )
    from explore3d.bench.precision.work_precision import Measured as Measured

_PUBLIC = {
    "bench": ("as_record", "bench", "summary", "write"),
    "work_precision": ("Measured",),
}
doorway(__name__, _PUBLIC)
