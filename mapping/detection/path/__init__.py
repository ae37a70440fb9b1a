"""The ledger of the path: sweeps that can be inspected, whatever their numbers, and what became of every metre."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.detection.path.backlash import (
        Backlash as Backlash,
        Lag as Lag,
        backlash as backlash,
        with_doubt as with_doubt,
        without_backlash as without_backlash,
    )
    from mapping.detection.path.ledger import PathLedger as PathLedger, path_ledger as path_ledger
    from mapping.detection.path.lifted import Lifted as Lifted, lifted as lifted
    from mapping.detection.path.sound_sweeps import SoundSweeps as SoundSweeps, sound_sweeps as sound_sweeps
    from mapping.detection.path.sparse_samples import SparseSamples as SparseSamples, sparse_samples as sparse_samples

_PUBLIC = {
    "backlash": ("Backlash", "Lag", "backlash", "with_doubt", "without_backlash"),
    "ledger": ("PathLedger", "path_ledger"),
    "lifted": ("Lifted", "lifted"),
    "sound_sweeps": ("SoundSweeps", "sound_sweeps"),
    "sparse_samples": ("SparseSamples", "sparse_samples"),
}
doorway(__name__, _PUBLIC)
