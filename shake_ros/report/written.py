"""A page into a result folder, with static copies of its charts where they are wanted."""

from __future__ import annotations

from pathlib import Path

from shake_ros.report.page import Page


def write_page(page: Page, folder: Path, figures: str | None = None, name: str = "report") -> None:
    """Write `name`.html; with `figures` (pdf, svg or png) the charts into the folder `name`_figures as well."""
    (folder / f"{name}.html").write_text(page.render(), encoding="utf-8")
    if figures:
        from shake_ros.report.static_figure import save_figures  # brings matplotlib, which is slow to load

        save_figures(page.charts, folder / f"{name}_figures", figures)
