"""Export: what was found in the forms of others, by the name of the file."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.jobs.export.crate import CRATE as CRATE
    from explore3d.jobs.export.export import export as export, may_be_written as may_be_written

_PUBLIC = {"crate": ("CRATE",), "export": ("export", "may_be_written")}
doorway(__name__, _PUBLIC)
