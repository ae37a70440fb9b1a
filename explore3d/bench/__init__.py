"""Benches: error against run time, beside other programs."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.bench.apparatus import findings_table as findings_table, write_apparatus as write_apparatus
    from explore3d.bench.curvature import (
        CurvatureAccuracy as CurvatureAccuracy,
        CurvatureCell as CurvatureCell,
        available as available,
        bench_cells as bench_cells,
        bench_curvature as bench_curvature,
        cell_table as cell_table,
        cell_verdicts as cell_verdicts,
        curvature_table as curvature_table,
        write_bench as write_bench,
        write_cells as write_cells,
    )
    from explore3d.bench.dynamics import (
        dynamics_curve as dynamics_curve,
        dynamics_table as dynamics_table,
        wire_trace as wire_trace,
    )
    from explore3d.bench.figures import write_figures as write_figures
    from explore3d.bench.scaling import AXES as AXES, bench_scaling as bench_scaling, scaling_lines as scaling_lines
    from explore3d.bench.sections import (
        bench_sections as bench_sections,
        is_flagged as is_flagged,
        is_stated as is_stated,
        judged_size as judged_size,
        section_lines as section_lines,
        section_trial as section_trial,
    )
    from explore3d.bench.trace import (
        PEER_SECONDS as PEER_SECONDS,
        TRACED_MESH_SIZES as TRACED_MESH_SIZES,
        bench_trace as bench_trace,
        bump_mesh as bump_mesh,
        by_opencamlib as by_opencamlib,
        trace_methods as trace_methods,
        trace_table as trace_table,
    )
    from explore3d.bench.wrong_models import (
        bench_wrong_models as bench_wrong_models,
        wrong_model_lines as wrong_model_lines,
        wrong_model_records as wrong_model_records,
        wrong_model_run as wrong_model_run,
    )

_PUBLIC = {
    "apparatus": ("findings_table", "write_apparatus"),
    "curvature": (
        "CurvatureAccuracy",
        "CurvatureCell",
        "available",
        "bench_cells",
        "bench_curvature",
        "cell_table",
        "cell_verdicts",
        "curvature_table",
        "write_bench",
        "write_cells",
    ),
    "dynamics": ("dynamics_curve", "dynamics_table", "wire_trace"),
    "figures": ("write_figures",),
    "scaling": ("AXES", "bench_scaling", "scaling_lines"),
    "sections": ("bench_sections", "is_flagged", "is_stated", "judged_size", "section_lines", "section_trial"),
    "trace": (
        "PEER_SECONDS",
        "TRACED_MESH_SIZES",
        "bench_trace",
        "bump_mesh",
        "by_opencamlib",
        "trace_methods",
        "trace_table",
    ),
    "wrong_models": ("bench_wrong_models", "wrong_model_lines", "wrong_model_records", "wrong_model_run"),
}
doorway(__name__, _PUBLIC)
