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
        self._looked, self._longest = time.monotonic(), 0.0

    def over(self) -> bool:
        """Look at the clock: is the time up?"""
        now = time.monotonic()
        self._longest = max(self._longest, now - self._looked)
        self.left -= min(now - self._looked, LONGEST_LOOK)
        self._looked = now
        return self.left <= 0.0

    def at_least(self, left: float) -> None:
        """From now on there are at least so many seconds left."""
        self.left = max(self.left, left)

    @property
    def held_up(self) -> str:
        """Words for the end of a message if this program could not look for long: then the fault may be the host's."""
        if self._longest <= LONGEST_LOOK:
            return ""
        return f" (this program was held up for {self._longest:.1f} s meanwhile: is the host busy?)"
