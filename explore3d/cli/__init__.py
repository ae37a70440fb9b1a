"""The command line: each command is a thin function round one call."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.cli.main import main as main

_PUBLIC = {
    "main": ("main",),
}
doorway(__name__, _PUBLIC)
