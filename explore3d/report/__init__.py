"""The report: one page that opens offline."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.report.findings import (
        feature_line as feature_line,
        groove_sentence as groove_sentence,
        show as show,
    )
    from explore3d.report.markup import (
        Html as Html,
        badge as badge,
        element as element,
        figure as figure,
        paragraph as paragraph,
        section as section,
        table as table,
    )
    from explore3d.report.page import machine as machine, machine_section as machine_section, page as page
    from explore3d.report.report import write_report as write_report
    from explore3d.report.view3d import (
        LEAST_FEATURE_SHARE as LEAST_FEATURE_SHARE,
        NOTICED_COLOUR as NOTICED_COLOUR,
        SWEEP_COLOUR as SWEEP_COLOUR,
        VIEW_BASE_COLOUR as VIEW_BASE_COLOUR,
        lighter as lighter,
    )

_PUBLIC = {
    "findings": ("feature_line", "groove_sentence", "show"),
    "markup": ("Html", "badge", "element", "figure", "paragraph", "section", "table"),
    "page": ("machine", "machine_section", "page"),
    "report": ("write_report",),
    "view3d": ("LEAST_FEATURE_SHARE", "NOTICED_COLOUR", "SWEEP_COLOUR", "VIEW_BASE_COLOUR", "lighter"),
}
doorway(__name__, _PUBLIC)
