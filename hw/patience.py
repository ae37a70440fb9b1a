"""Patience: a time-out that counts only the time in which this program could have looked."""

from __future__ import annotations

import time

# Between two looks at the clock at most this much counts, s: five times the longest wait between looks (0.05 s). What
# is more was a pause of this program (stopped, swapped out, the host asleep), not a silence of the device
LONGEST_LOOK = 0.25


class Patience:
    """Runs out after `within` seconds of waiting; a pause of the host hardly counts.

    Args:
        within: s.
    """

    def __init__(self, within: float) -> None:
        self.left = within
        self._looked = time.monotonic()

    def over(self) -> bool:
        """Look at the clock: is the time up?"""
        now = time.monotonic()
        self.left -= min(now - self._looked, LONGEST_LOOK)
        self._looked = now
        return self.left <= 0.0

    def at_least(self, left: float) -> None:
        """From now on there are at least so many seconds left."""
        self.left = max(self.left, left)
