"""Work that need not be done at once waits for the pause between the answer to one sample and the next sample."""

from __future__ import annotations

from collections.abc import Callable


class Pause:
    """What a node puts off while samples come.

    A report on /diagnostics takes half a period; in the middle of the way from a sample to its command it makes that
    command late.

    >>> pause = Pause()
    >>> pause.put_off(lambda: print("at once, no sample has come"))
    at once, no sample has come
    >>> pause.begins()
    >>> pause.put_off(lambda: print("after the next sample"))
    >>> pause.begins()
    after the next sample
    """

    def __init__(self) -> None:
        self._answered = False  # since something was last put off
        self._waiting: list[Callable[[], None]] = []

    def put_off(self, act: Callable[[], None]) -> None:
        """Do it in the next pause; at once where no sample has been answered since this was last called."""
        if self._answered:
            self._waiting.append(act)
        else:
            self._do_all()
            act()
        self._answered = False

    def begins(self) -> None:
        """A sample has been answered."""
        self._answered = True
        if self._waiting:
            self._do_all()

    def _do_all(self) -> None:
        waiting, self._waiting = self._waiting, []
        for act in waiting:
            act()
