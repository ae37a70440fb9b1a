"""The analysis: stages from the log to the annotated model, and what came of it."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.analysis.arviz_export import arviz_export as arviz_export
    from explore3d.analysis.build_model import build_model as build_model
    from explore3d.analysis.feature_table import (
        FEATURE_COLUMNS as FEATURE_COLUMNS,
        csv_text as csv_text,
        feature_rows as feature_rows,
        parquet_bytes as parquet_bytes,
        run_key as run_key,
    )
    from explore3d.analysis.forecast import Forecast as Forecast, forecast as forecast, worst_errors as worst_errors
    from explore3d.analysis.memory import give_memory_back as give_memory_back, leave_no_holes as leave_no_holes
    from explore3d.analysis.method import ABSORBED as ABSORBED, FAILED as FAILED
    from explore3d.analysis.result import Analysis as Analysis, Computing as Computing
    from explore3d.analysis.roughness import (
        Roughness as Roughness,
        residual as residual,
        roughness_of as roughness_of,
        why_no_roughness_of as why_no_roughness_of,
    )
    from explore3d.analysis.savings import without_needless_dynamics as without_needless_dynamics
    from explore3d.analysis.stages import (
        FINGER_STAGE as FINGER_STAGE,
        Progress as Progress,
        Stages as Stages,
        silent as silent,
    )
    from explore3d.analysis.standard_heights import (
        STANDARDS_SENTENCE as STANDARDS_SENTENCE,
        StandardHeight as StandardHeight,
        standard_heights as standard_heights,
    )
    from explore3d.analysis.surface_account import (
        SurfaceAccount as SurfaceAccount,
        swept_share as swept_share,
        unmodelled_share as unmodelled_share,
    )
    from explore3d.analysis.truth import Comparison as Comparison, TrueFeature as TrueFeature, compare as compare

_PUBLIC = {
    "arviz_export": ("arviz_export",),
    "build_model": ("build_model",),
    "feature_table": ("FEATURE_COLUMNS", "csv_text", "feature_rows", "parquet_bytes", "run_key"),
    "forecast": ("Forecast", "forecast", "worst_errors"),
    "memory": ("give_memory_back", "leave_no_holes"),
    "method": ("ABSORBED", "FAILED"),
    "result": ("Analysis", "Computing"),
    "roughness": ("Roughness", "residual", "roughness_of", "why_no_roughness_of"),
    "savings": ("without_needless_dynamics",),
    "stages": ("FINGER_STAGE", "Progress", "Stages", "silent"),
    "standard_heights": ("STANDARDS_SENTENCE", "StandardHeight", "standard_heights"),
    "surface_account": ("SurfaceAccount", "swept_share", "unmodelled_share"),
    "truth": ("Comparison", "TrueFeature", "compare"),
}
doorway(__name__, _PUBLIC)
