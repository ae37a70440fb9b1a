"""Inference: the posterior of one feature; that of all together has its own room."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.inference.evidence import (
        log_evidence as log_evidence,
        log_evidence_of_nothing as log_evidence_of_nothing,
    )
    from mapping.inference.feature_posterior import (
        Solution as Solution,
        pose_problem as pose_problem,
        refine as refine,
        sample_posterior as sample_posterior,
        settle as settle,
        solve as solve,
        solve_problem as solve_problem,
    )
    from mapping.inference.kind_odds import as_broken as as_broken, as_bump as as_bump
    from mapping.inference.pooled_residual import (
        POOLED_SPLINES as POOLED_SPLINES,
        REMARKED_CHANCE as REMARKED_CHANCE,
    )
    from mapping.inference.summary import (
        describe as describe,
        described_at as described_at,
        with_open_ends as with_open_ends,
    )
    from mapping.inference.trace_noise import noise_of_trace as noise_of_trace

_PUBLIC = {
    "evidence": ("log_evidence", "log_evidence_of_nothing"),
    "feature_posterior": ("Solution", "pose_problem", "refine", "sample_posterior", "settle", "solve", "solve_problem"),
    "kind_odds": ("as_broken", "as_bump"),
    "pooled_residual": ("POOLED_SPLINES", "REMARKED_CHANCE"),
    "summary": ("describe", "described_at", "with_open_ends"),
    "trace_noise": ("noise_of_trace",),
}
doorway(__name__, _PUBLIC)
