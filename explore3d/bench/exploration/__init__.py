"""Benches of exploring: strategies against each other, and bodies of any form judged by brute force."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.bench.exploration.bodies import (
        bench_bodies as bench_bodies,
        body_lines as body_lines,
        body_records as body_records,
    )
    from explore3d.bench.exploration.explore_curves import write_curves as write_curves
    from explore3d.bench.exploration.exploring import (
        FAST as FAST,
        FINGER_NOISES as FINGER_NOISES,
        PRECISION as PRECISION,
        STRATEGIES as STRATEGIES,
        bench_exploring as bench_exploring,
        one_run as one_run,
        records as records,
        write_bench_scenes as write_bench_scenes,
    )

_PUBLIC = {
    "bodies": ("bench_bodies", "body_lines", "body_records"),
    "explore_curves": ("write_curves",),
    "exploring": (
        "FAST",
        "FINGER_NOISES",
        "PRECISION",
        "STRATEGIES",
        "bench_exploring",
        "one_run",
        "records",
        "write_bench_scenes",
    ),
}
doorway(__name__, _PUBLIC)
