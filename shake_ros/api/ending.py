"""How a long search ends early: after some minutes, or at Ctrl-C, with what it has found so far.

Between its steps it is stopped; a fit that is under way ends where it is.
"""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from types import TracebackType

from shake_ros.api.progress import Progress
from shake_ros.core.discovery.problem import Stopped
from shake_ros.core.identification.haste import in_haste
from shake_ros.core.quantities import ShakeError


class Ending:
    """Progress that ends a search once its minutes are over or Ctrl-C has been pressed; the second Ctrl-C interrupts.

    Parameters
    ----------
    progress : that is told as well. minutes : after which the search is to end; None for no limit.
    """

    def __init__(self, progress: Progress, minutes: float | None = None) -> None:
        if minutes is not None and not minutes > 0.0:
            raise ShakeError(f"minutes = {minutes:g}: must be above 0")
        self._progress = progress
        self._last = None if minutes is None else time.monotonic() + 60.0 * minutes
        self._asked = False
        self._before: object = None
        self._haste = contextlib.ExitStack()
        self._watching = threading.current_thread() is threading.main_thread()

    def __call__(self, text: str, part: float) -> None:
        """Tell the progress, and end the search where it is time."""
        if self._last is not None:
            self._progress.left((self._last - time.monotonic()) / 60.0)
        self._progress(text, part)
        if self.over():
            raise Stopped

    def over(self) -> bool:
        """Whether it is time to end."""
        return self._asked or (self._last is not None and time.monotonic() > self._last)

    def __enter__(self) -> Ending:
        self._haste.enter_context(in_haste(self.over))
        if self._watching:
            self._before = signal.signal(signal.SIGINT, self._interrupted)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._haste.close()
        if self._watching:
            signal.signal(signal.SIGINT, self._before)  # type: ignore[arg-type]

    def _interrupted(self, *_: object) -> None:
        if self._asked:
            raise KeyboardInterrupt
        self._asked = True
        self._progress("ending with what is found; Ctrl-C once more leaves nothing", 0.0)
