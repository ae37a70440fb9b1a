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
    from explore3d.bench.precision.labels import (
        LABEL_BODIES as LABEL_BODIES,
        bench_labels as bench_labels,
        label_lines as label_lines,
    )
    from explore3d.bench.precision.lengths import (
        LENGTHS_FORMS as LENGTHS_FORMS,
        LENGTHS_NOISES as LENGTHS_NOISES,
        bench_lengths as bench_lengths,
        lengths_trace as lengths_trace,
    )
    from explore3d.bench.precision.profiles import (
        FIRST_REPORTED as FIRST_REPORTED,
        PROFILE_FORMS as PROFILE_FORMS,
        bench_profiles as bench_profiles,
        profile_trial as profile_trial,
    )
    from explore3d.bench.precision.work_precision import Measured as Measured

_PUBLIC = {
    "bench": ("as_record", "bench", "summary", "write"),
    "labels": ("LABEL_BODIES", "bench_labels", "label_lines"),
    "lengths": ("LENGTHS_FORMS", "LENGTHS_NOISES", "bench_lengths", "lengths_trace"),
    "profiles": ("FIRST_REPORTED", "PROFILE_FORMS", "bench_profiles", "profile_trial"),
    "work_precision": ("Measured",),
}
doorway(__name__, _PUBLIC)
