"""A progress bar on standard error for work that takes longer than a second."""

from __future__ import annotations

import sys
from types import TracebackType

from tqdm import tqdm


class Bar:
    """A bar that is told what is being done and which part of the whole is done.

    On a terminal it is redrawn; elsewhere each change of what is being done is one line.
    """

    def __init__(self, title: str) -> None:
        self._terminal = sys.stderr.isatty()
        form = "{desc:<44.44}|{bar:24}| {percentage:3.0f} % {elapsed}"
        self._bar = tqdm(total=1.0, desc=title, bar_format=form, disable=not self._terminal, file=sys.stderr)
        self._title = title
        self._text = ""
        self._low, self._high = 0.0, 1.0

    def span(self, low: float, high: float) -> None:
        """Parts told from now on count from `low` to `high` of the whole bar."""
        self._low, self._high = low, high

    def __call__(self, text: str, part: float) -> None:
        """Say what is being done and which part of the present span is done; the bar never goes back."""
        whole = self._low + (self._high - self._low) * min(max(part, 0.0), 1.0)
        if self._terminal:
            self._bar.n = max(self._bar.n, whole)
            self._bar.set_description_str(f"{self._title}: {text}")
        elif text != self._text:
            print(f"{self._title}: {text}", file=sys.stderr, flush=True)
        self._text = text

    def __enter__(self) -> Bar:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None and self._terminal:
            self._bar.n = 1.0
            self._bar.refresh()
        self._bar.close()
