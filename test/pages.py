"""Reads a page of a report: its texts, its tables, its charts; and checks that it needs nothing from outside."""

from __future__ import annotations

import html.parser
import json
import re
from typing import Any

LARGEST = 6_000_000  # [byte]
REFERENCE = re.compile(r"(?:src|srcset|action)\s*=|url\(|@import|fetch\(|XMLHttpRequest|WebSocket|import\(")


class Reader(html.parser.HTMLParser):
    """Collects links, headings, tables, charts and unclosed tags of a page."""

    VOID = frozenset({"meta", "img", "br", "link", "hr", "input", "wbr"})

    def __init__(self, page: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.open: list[str] = []
        self.identities: list[str] = []
        self.headings: list[str] = []
        self.rows: list[list[str]] = []
        self.charts: list[Any] = []
        self.words = ""
        self.code = ""
        self._chart = False
        self.feed(page)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        known = dict(attributes)
        self.links += [value or "" for name, value in attributes if name in ("src", "href", "srcset", "data")]
        self.identities += [value or "" for name, value in attributes if name == "id"]
        assert tag not in ("link", "iframe", "object", "embed", "form")
        assert tag != "script" or "src" not in known
        self._chart = tag == "script" and known.get("type") == "application/json"
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        if tag == "h2":
            self.headings.append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        data = data.replace("\u00a0", " ")
        where = self.open[-1] if self.open else ""
        if where == "script" and self._chart:
            self.charts.append(json.loads(data))
        elif where in ("script", "style"):
            self.code += data
        else:
            self.words += data + " "
        if {"td", "th"} & set(self.open[-2:]):
            self.rows[-1][-1] += data
        if where == "h2":
            self.headings[-1] += data


def read_page(page: str) -> Reader:
    """The page's content; it is one file of some size, needs no other, and every tag and every link within it fits."""
    assert len(page.encode()) < LARGEST
    reader = Reader(page)
    assert reader.open == []
    assert not REFERENCE.search(reader.code), REFERENCE.search(reader.code)
    assert all(link.startswith("#") and link[1:] in reader.identities for link in reader.links)
    assert len(set(reader.identities)) == len(reader.identities)
    assert "default-src 'none'" in page
    assert reader.headings[-1] == "Where this comes from"
    return reader
