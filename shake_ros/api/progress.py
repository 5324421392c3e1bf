"""Progress of work that takes longer than a second: a bar in a terminal or a notebook, lines where there is neither."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from types import TracebackType

from tqdm import tqdm as plain
from tqdm.auto import tqdm

Told = bool | Callable[[str, float], None]  # whether progress is shown, or who is told what is done and which part

TERMINAL = "{desc:<44.44}|{bar:24}| {percentage:3.0f} % {elapsed}"
LIMITED = "{desc:<41.41}|{bar:10}| {percentage:3.0f} % {elapsed}{postfix}"  # with the minutes that are left
PARTS = os.environ.get("SHAKE_ROS_PROGRESS") == "parts"  # who follows a process wants every part, in a form to read
SO_FAR = "so far "  # begins an answer that work has before its end
NOTEBOOK = "{desc}{bar} {percentage:3.0f} % {elapsed}{postfix}"


class Progress:
    """Is told what is being done and which part of the whole is done.

    A bar is redrawn; elsewhere each change of what is being done is one line on standard error.

    Parameters
    ----------
    title : of the work. told : whether to show it, or a function to tell instead.
    """

    def __init__(self, title: str, told: Told = True) -> None:
        notebook = hasattr(tqdm, "display") and tqdm.display is not plain.display
        self._told = told
        drawn = told is True and (notebook or sys.stderr.isatty())
        form = NOTEBOOK if notebook else TERMINAL
        # without a bar no lock of tqdm's, which a process that is ended at once would leave behind
        self._bar = tqdm(total=1.0, desc=title, bar_format=form, file=sys.stderr) if drawn else None
        self._title = title
        self._text = ""
        self._low, self._high = 0.0, 1.0

    def span(self, low: float, high: float) -> None:
        """Parts told from now on count from `low` to `high` of the whole."""
        self._low, self._high = low, high

    def left(self, minutes: float) -> None:
        """Show how many minutes are left, where a bar is drawn."""
        if self._bar is not None:
            if self._bar.bar_format == TERMINAL:
                self._bar.bar_format = LIMITED
            self._bar.set_postfix_str(f"{max(minutes, 0.0):.1f} min left", refresh=False)

    def __call__(self, text: str, part: float) -> None:
        """Say what is being done and which part of the present span is done; the bar never goes back."""
        whole = self._low + (self._high - self._low) * min(max(part, 0.0), 1.0)
        if text.startswith(SO_FAR) and self._told is True:
            tqdm.write(f"{self._title}: {text}", file=sys.stderr)  # stays above the bar
            sys.stderr.flush()
            return
        if self._bar is not None:
            self._bar.n = max(self._bar.n, whole)
            self._bar.set_description_str(f"{self._title}: {text}")
        elif callable(self._told):
            self._told(text, whole)
        elif self._told and PARTS:
            sys.stderr.write(f"{whole:.4f}\t{self._title}: {text}\n")
            sys.stderr.flush()
        elif self._told and text != self._text:
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
