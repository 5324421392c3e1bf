"""What a verb found, for whoever asks: numbers for programs, a page for a reader, its text for a terminal."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, ClassVar

from shake_ros.report.page import Page, write_page
from shake_ros.result_folder import new_folder, write_json


class Result(ABC):
    """A result that is described once, by `page`, and printed as the text of that.

    Attributes
    ----------
    numbers, page_name : of the files of `content` and of the page.
    """

    numbers: ClassVar[str] = "report.json"
    page_name: ClassVar[str] = "report"

    @abstractmethod
    def content(self) -> Any:
        """All figures, for JSON."""

    @property
    @abstractmethod
    def page(self) -> Page:
        """What was found, in words, tables and charts."""

    def files(self, work: Path, folder: Path, /) -> None:  # noqa: B027 (some have none)
        """Write what stands beside page and numbers into `work`, which becomes `folder`."""

    def report(self, folder: str | Path, force: bool = False, *, figures: str | None = None, command: str = "") -> Path:
        """Write the page, its numbers as JSON, and what a program goes on with.

        Parameters
        ----------
        folder : of the result.
        force : replace an existing one.
        figures : adds static copies of the charts, as "pdf", "svg" or "png".
        command : line that the page names as its origin.

        Raises
        ------
        ShakeError : the folder is there and `force` is not given.
        """
        with new_folder(Path(folder), force=force) as work:
            write_json(work / self.numbers, self.content())
            write_page(self.page, work, figures, self.page_name, command)
            self.files(work, Path(folder))
        return Path(folder)

    def __repr__(self) -> str:
        return self.page.text()

    def _repr_html_(self) -> str:
        return self.page.brief()
