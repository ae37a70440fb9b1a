"""Linking: which crossings are one line and where it ends, by what was inspected beside and between them."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.assembly.linking.branches import (
        Branch as Branch,
        branches as branches,
        joined as joined,
        main_line as main_line,
        rejoined as rejoined,
    )
    from mapping.assembly.linking.inspection import Inspection as Inspection, Inspections as Inspections
    from mapping.assembly.linking.line_ends import (
        LineEnd as LineEnd,
        closes as closes,
        ended_length as ended_length,
        line_end as line_end,
    )
    from mapping.assembly.linking.linking import (
        FELT_REACH as FELT_REACH,
        HEIGHT_RATIO as HEIGHT_RATIO,
        LONGEST_LINK as LONGEST_LINK,
        between as between,
        groups as groups,
        uphill as uphill,
    )
    from mapping.assembly.linking.rested_on import ONE_PLACE as ONE_PLACE, rested_on as rested_on
    from mapping.assembly.linking.strokes import strokes as strokes
    from mapping.assembly.linking.summits import summits as summits

_PUBLIC = {
    "branches": ("Branch", "branches", "joined", "main_line", "rejoined"),
    "inspection": ("Inspection", "Inspections"),
    "line_ends": ("LineEnd", "closes", "ended_length", "line_end"),
    "linking": ("FELT_REACH", "HEIGHT_RATIO", "LONGEST_LINK", "between", "groups", "uphill"),
    "rested_on": ("ONE_PLACE", "rested_on"),
    "strokes": ("strokes",),
    "summits": ("summits",),
}
doorway(__name__, _PUBLIC)
