"""Work that takes longer than a second: its progress in a terminal, notebook or log, and its early end.

A long search ends after some minutes, or at Ctrl-C, with what it has found so far.

Between its steps it is stopped; a fit that is under way ends where it is. The verdicts come after that, from fits that
go on to their end, but for no longer than a part of the time that the search has had.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from types import TracebackType

from tqdm import tqdm as plain
from tqdm.auto import tqdm

from shake_ros.fit.least_squares import within_budget
from shake_ros.quantities import ShakeError
from shake_ros.search.problem import Stopped

ProgressOption = (
    bool | Callable[[str, float], None]
)  # whether progress is shown, or a function of what is done and which part

TERMINAL = "{desc:<44.44}|{bar:24}| {percentage:3.0f} % {elapsed}"
LIMITED = "{desc:<41.41}|{bar:10}| {percentage:3.0f} % {elapsed}{postfix}"  # with the minutes that are left
FOLLOWED = os.environ.get("SHAKE_ROS_PROGRESS") == "parts"  # by a process that wants every part, in a form to read
SO_FAR = "best so far: "  # begins an answer that work has before its end
NOTEBOOK = "{desc}{bar} {percentage:3.0f} % {elapsed}{postfix}"


class Progress:
    """Called with what is being done and the part of the whole that is done.

    A bar is redrawn; elsewhere each change of what is being done is one line on standard error.

    Parameters
    ----------
    title : of the work.
    shown : whether to show it, or a function to call instead.
    """

    def __init__(self, title: str, shown: ProgressOption = True) -> None:
        notebook = hasattr(tqdm, "display") and tqdm.display is not plain.display
        self._shown = shown
        drawn = shown is True and (notebook or sys.stderr.isatty())
        form = NOTEBOOK if notebook else TERMINAL
        # without a bar no lock of tqdm's, which a process that is ended at once would leave behind
        self._bar = tqdm(total=1.0, desc=title, bar_format=form, file=sys.stderr) if drawn else None
        self._title = title
        self._text = ""
        self._low, self._high = 0.0, 1.0

    def span(self, low: float, high: float) -> None:
        """Parts reported from now on count from `low` to `high` of the whole."""
        self._low, self._high = low, high

    def left(self, minutes: float) -> None:
        """Show how many minutes are left, where a bar is drawn."""
        if self._bar is not None:
            if self._bar.bar_format == TERMINAL:
                self._bar.bar_format = LIMITED
            self._bar.set_postfix_str(f"{max(minutes, 0.0):.1f} min left", refresh=False)

    def __call__(self, text: str, part: float) -> None:
        """Report what is being done and which part of the present span is done; the bar never goes back."""
        whole = self._low + (self._high - self._low) * min(max(part, 0.0), 1.0)
        if text.startswith(SO_FAR) and self._shown is True:
            tqdm.write(f"{self._title}: {text}", file=sys.stderr)  # stays above the bar
            sys.stderr.flush()
            return
        if self._bar is not None:
            self._bar.n = max(self._bar.n, whole)
            self._bar.set_description_str(f"{self._title}: {text}")
        elif callable(self._shown):
            self._shown(text, whole)
        elif self._shown and FOLLOWED:
            sys.stderr.write(f"{whole:.4f}\t{self._title}: {text}\n")
            sys.stderr.flush()
        elif self._shown and text != self._text:
            sys.stderr.write(f"{self._title}: {text}\n")
            sys.stderr.flush()
        self._text = text

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            if kind is None:
                self._bar.n = 1.0
                self._bar.set_postfix_str("")
            self._bar.close()


ASSESSING = 0.2  # part of the minutes given that is kept for the verdicts
INTERRUPTED = 20.0  # that they may take after Ctrl-C [s]


class Ending:
    """Progress that ends a search once its minutes are over or Ctrl-C has been pressed; the second Ctrl-C interrupts.

    Parameters
    ----------
    progress : called as well.
    minutes : time budget of the search and of the verdicts on what it finds; None for no limit.
    """

    def __init__(self, progress: Progress, minutes: float | None = None) -> None:
        if minutes is not None and not minutes > 0.0:
            raise ShakeError(f"minutes = {minutes:g}: must be above 0")
        self._progress = progress
        seconds = math.inf if minutes is None else 60.0 * minutes
        self._last = time.monotonic() + seconds
        self._reserved = ASSESSING * seconds if minutes else 0.0
        self._asked = math.inf
        self._before: object = None
        self._budget = contextlib.ExitStack()
        self._watching = threading.current_thread() is threading.main_thread()

    def __call__(self, text: str, part: float) -> None:
        """Report the progress, and end the search where it is time."""
        if self._last < math.inf:
            self._progress.left((self._last - time.monotonic()) / 60.0)
        self._progress(text, part)
        if self.over():
            raise Stopped

    def over(self) -> bool:
        """Whether it is time to end the search."""
        return time.monotonic() > min(self._asked, self._last - self._reserved)

    def deadline_passed(self) -> bool:
        """Whether it is time to end all that follows the search as well."""
        return time.monotonic() > min(self._asked + INTERRUPTED, self._last)

    def __enter__(self) -> Ending:
        self._budget.enter_context(within_budget(self.over))
        if self._watching:
            self._before = signal.signal(signal.SIGINT, self._interrupted)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._budget.close()
        if self._watching:
            signal.signal(signal.SIGINT, self._before)  # type: ignore[arg-type]

    def _interrupted(self, *_: object) -> None:
        if self._asked < math.inf:
            raise KeyboardInterrupt
        self._asked = time.monotonic()
        self._progress("ending with what has been found; press Ctrl-C again to discard it", 0.0)
