"""Rates of detection, of false alarms and of right kinds."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.bench.detection.classify import (
        NOISE_SOURCES as NOISE_SOURCES,
        SWEEP_PATTERNS as SWEEP_PATTERNS,
        bench_classify as bench_classify,
        classify_table as classify_table,
    )
    from explore3d.bench.detection.detect import all_cases as all_cases, bench_detect as bench_detect, cells as cells
    from explore3d.bench.detection.detect_curves import write_curves as write_curves
    from explore3d.bench.detection.false_alarms import (
        bench_false_alarms as bench_false_alarms,
        false_alarm_lines as false_alarm_lines,
    )
    from explore3d.bench.detection.shape_picture import write_shapes as write_shapes
    from explore3d.bench.detection.shapes import (
        bench_shapes as bench_shapes,
        judged as judged,
        shape_lines as shape_lines,
        shape_trial as shape_trial,
    )

_PUBLIC = {
    "classify": ("NOISE_SOURCES", "SWEEP_PATTERNS", "bench_classify", "classify_table"),
    "detect": ("all_cases", "bench_detect", "cells"),
    "detect_curves": ("write_curves",),
    "false_alarms": ("bench_false_alarms", "false_alarm_lines"),
    "shape_picture": ("write_shapes",),
    "shapes": ("bench_shapes", "judged", "shape_lines", "shape_trial"),
}
doorway(__name__, _PUBLIC)
