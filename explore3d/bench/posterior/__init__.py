"""Calibration of posteriors and of odds."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.bench.posterior.calibration import (
        CALIBRATED_KINDS as CALIBRATED_KINDS,
        calibrate as calibrate,
        campaign as campaign,
    )
    from explore3d.bench.posterior.calibration_verdicts import (
        by_kind as by_kind,
        draw_ranks as draw_ranks,
        verdicts as verdicts,
        write_record as write_record,
    )
    from explore3d.bench.posterior.counts import bench_counts as bench_counts, counts_table as counts_table
    from explore3d.bench.posterior.odds import bench_odds as bench_odds, odds_table as odds_table
    from explore3d.bench.posterior.sampling import (
        APPARATUS_NOISE as APPARATUS_NOISE,
        DIAMETER as DIAMETER,
        Timing as Timing,
        bench_posterior as bench_posterior,
        crossings as crossings,
    )

_PUBLIC = {
    "calibration": ("CALIBRATED_KINDS", "calibrate", "campaign"),
    "calibration_verdicts": ("by_kind", "draw_ranks", "verdicts", "write_record"),
    "counts": ("bench_counts", "counts_table"),
    "odds": ("bench_odds", "odds_table"),
    "sampling": ("APPARATUS_NOISE", "DIAMETER", "Timing", "bench_posterior", "crossings"),
}
doorway(__name__, _PUBLIC)
