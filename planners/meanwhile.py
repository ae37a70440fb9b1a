"""Meanwhile: what the next move does not depend on is worked out while the finger carries that move out."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass
class Meanwhile:
    """Pieces of work that wait for the finger to move, done in the order in which they came.

    Whoever carries moves out does some of them meanwhile; the plan does what is left when it needs what comes out. It
    goes the same way however many were done when.
    """

    _pieces: deque[Callable[[], None]] = field(init=False, default_factory=deque)
    _failure: BaseException | None = field(init=False, default=None)

    def later(self, piece: Callable[[], None]) -> None:
        """Have a piece of work done once the finger moves again."""
        self._pieces.append(piece)

    @property
    def waiting(self) -> bool:
        """True if there is something to do."""
        return bool(self._pieces) and self._failure is None

    def work(self) -> None:
        """Do the next piece, if there is one. What it raises is kept for the plan, whose work it is."""
        if self.waiting:
            try:
                self._pieces.popleft()()
            except BaseException as error:
                self._failure = error

    def finish(self) -> None:
        """Do what is left. Raises what a piece raised."""
        while self.waiting:
            self.work()
        if self._failure is not None:
            failure, self._failure = self._failure, None
            self._pieces.clear()
            raise failure
