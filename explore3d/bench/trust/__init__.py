"""Trust: what is promised, held against simulated instruments and bodies that nothing was built with."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.bench.trust.case import (
        TRUST_SETS as TRUST_SETS,
        Case as Case,
        bench_trust as bench_trust,
        recordings_of as recordings_of,
        run_trust_case as run_trust_case,
        trust_records as trust_records,
    )
    from explore3d.bench.trust.laws import LAWS as LAWS
    from explore3d.bench.trust.paths import TRUST_BODIES as TRUST_BODIES
    from explore3d.bench.trust.tip_cases import (
        TipCase as TipCase,
        bench_tips as bench_tips,
        run_tip_case as run_tip_case,
        tip_line as tip_line,
        tip_table as tip_table,
    )
    from explore3d.bench.trust.tips import WRONG_TIPS as WRONG_TIPS
    from explore3d.bench.trust.verdicts import (
        Verdict as Verdict,
        law_verdicts as law_verdicts,
        trust_line as trust_line,
        verdict_lines as verdict_lines,
        write_trust as write_trust,
    )

_PUBLIC = {
    "case": ("Case", "TRUST_SETS", "bench_trust", "recordings_of", "run_trust_case", "trust_records"),
    "laws": ("LAWS",),
    "paths": ("TRUST_BODIES",),
    "tip_cases": ("TipCase", "bench_tips", "run_tip_case", "tip_line", "tip_table"),
    "tips": ("WRONG_TIPS",),
    "verdicts": ("Verdict", "law_verdicts", "trust_line", "verdict_lines", "write_trust"),
}
doorway(__name__, _PUBLIC)
