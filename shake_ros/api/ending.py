"""How a long search ends early: after some minutes, or at Ctrl-C, with what it has found so far.

Between its steps it is stopped; a fit that is under way ends where it is. How sure each effect is, is judged after that
by fits that go on to their end, but for no longer than a part of the time that the search has had.
"""

from __future__ import annotations

import contextlib
import math
import signal
import threading
import time
from types import TracebackType

from shake_ros.api.progress import Progress
from shake_ros.core.discovery.problem import Stopped
from shake_ros.core.identification.haste import in_haste
from shake_ros.core.quantities import ShakeError

JUDGING = 0.25  # part of the time until a search is ended early that judging what it has found may take
LEAST_JUDGING = 20.0  # [s] and at least


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
        self._began = time.monotonic()
        self._last = None if minutes is None else self._began + 60.0 * minutes
        self._asked: float | None = None
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
        """Whether it is time to end the search."""
        return time.monotonic() > self._end

    def overdue(self) -> bool:
        """Whether it is time to end all that follows the search as well."""
        return time.monotonic() > self._end + max(JUDGING * (self._end - self._began), LEAST_JUDGING)

    @property
    def _end(self) -> float:
        return min((t for t in (self._asked, self._last) if t is not None), default=math.inf)

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
        if self._asked is not None:
            raise KeyboardInterrupt
        self._asked = time.monotonic()
        self._progress("ending with what is found; Ctrl-C once more leaves nothing", 0.0)
