"""One self-contained HTML page: sections of text, tables and figures, readable without a network."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence

from matplotlib.figure import Figure

from shake_ros.report.style import png

STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; max-width: 62rem; margin: 2rem auto;
  padding: 0 1.25rem; color: #1d2733; background: #fff; }
h1 { font-size: 1.8rem; line-height: 1.2; margin-bottom: .3rem; }
h2 { margin-top: 2.6rem; font-size: 1.3rem; border-bottom: 2px solid #d7dee7; padding-bottom: .2rem; }
p.lead { font-size: 1.1rem; color: #3c4a5a; margin-top: 0; }
figure { margin: 1.2rem 0; }
figcaption { color: #566474; font-size: .92rem; }
img { max-width: 100%; height: auto; }
table { border-collapse: collapse; margin: 1rem 0; font-size: .93rem; display: block; overflow-x: auto; }
th, td { padding: .28rem .75rem; text-align: right; border-bottom: 1px solid #e3e8ee; vertical-align: bottom; }
td { white-space: nowrap; font-variant-numeric: tabular-nums; }
th:first-child, td:first-child { text-align: left; }
thead th { border-bottom: 2px solid #b9c4d0; color: #3c4a5a; }
tr.best td { background: #eaf4ec; }
.cards { display: flex; flex-wrap: wrap; gap: .8rem; margin: 1.2rem 0; }
.card { flex: 1 1 13rem; border: 1px solid #d7dee7; border-radius: .5rem; padding: .7rem .9rem; }
.card b { display: block; font-size: 1.35rem; }
.card span { color: #566474; font-size: .9rem; }
"""


class Page:
    """Collects sections and renders the page."""

    def __init__(self, title: str, lead: str) -> None:
        self._title = title
        self._parts = [f"<h1>{html.escape(title)}</h1><p class='lead'>{html.escape(lead)}</p>"]

    def heading(self, text: str) -> None:
        """A section's heading."""
        self._parts.append(f"<h2>{html.escape(text)}</h2>")

    def paragraph(self, text: str) -> None:
        """A paragraph of plain text."""
        self._parts.append(f"<p>{html.escape(text)}</p>")

    def cards(self, entries: Sequence[tuple[str, str]]) -> None:
        """A row of (value, meaning) cards."""
        cells = "".join(
            f"<div class='card'><b>{html.escape(v)}</b><span>{html.escape(m)}</span></div>" for v, m in entries
        )
        self._parts.append(f"<div class='cards'>{cells}</div>")

    def table(self, head: Sequence[str], rows: Sequence[Sequence[str]], best: int | None = None) -> None:
        """A table; row `best` is marked."""
        top = "".join(f"<th>{html.escape(h)}</th>" for h in head)
        body = "".join(
            f"<tr{' class=best' if i == best else ''}>" + "".join(f"<td>{html.escape(c)}</td>" for c in row) + "</tr>"
            for i, row in enumerate(rows)
        )
        self._parts.append(f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>")

    def figure(self, figure: Figure, caption: str) -> None:
        """A figure with its caption."""
        data = base64.b64encode(png(figure)).decode()
        text = html.escape(caption)
        self._parts.append(
            f"<figure><img alt='{text}' src='data:image/png;base64,{data}'><figcaption>{text}</figcaption></figure>"
        )

    def render(self) -> str:
        """The whole page."""
        return (
            "<!doctype html><html lang='en'><head><meta charset='utf-8'>"
            "<meta name='viewport' content='width=device-width, initial-scale=1'>"
            f"<title>{html.escape(self._title)}</title><style>{STYLE}</style></head><body>"
            + "\n".join(self._parts)
            + "</body></html>\n"
        )
