"""What is felt, while it is felt or afterwards: a view in the browser that grows with the log."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.report.watch.asked import asked as asked, over as over, when_input_ends as when_input_ends
    from explore3d.report.watch.feature_panel import feature_panel as feature_panel
    from explore3d.report.watch.touched import touched as touched
    from explore3d.report.watch.view import (
        ViewBeside as ViewBeside,
        Watch as Watch,
        need_viewer as need_viewer,
        watch as watch,
        watch_beside as watch_beside,
    )

_PUBLIC = {
    "asked": ("asked", "over", "when_input_ends"),
    "feature_panel": ("feature_panel",),
    "touched": ("touched",),
    "view": ("ViewBeside", "Watch", "need_viewer", "watch", "watch_beside"),
}
doorway(__name__, _PUBLIC)
