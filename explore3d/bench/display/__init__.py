"""What is felt of a display, and of the smallest things that people feel."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.bench.display.circle import bench_circle as bench_circle, circle_lines as circle_lines
    from explore3d.bench.display.ideal_observer import best_shares as best_shares
    from explore3d.bench.display.stepping import (
        Stepping as Stepping,
        bench_stepping as bench_stepping,
        stepping_body as stepping_body,
        stepping_lines as stepping_lines,
    )
    from explore3d.bench.display.touch import (
        HEAD_NOISES as HEAD_NOISES,
        Answer as Answer,
        bench_touch as bench_touch,
        touch_lines as touch_lines,
    )

_PUBLIC = {
    "circle": ("bench_circle", "circle_lines"),
    "ideal_observer": ("best_shares",),
    "stepping": ("Stepping", "bench_stepping", "stepping_body", "stepping_lines"),
    "touch": ("Answer", "HEAD_NOISES", "bench_touch", "touch_lines"),
}
doorway(__name__, _PUBLIC)
