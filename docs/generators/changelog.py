"""CHANGELOG.rst for bloom, of the released versions in CHANGELOG.md: `python -m docs.generators.changelog`."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TITLE = "Changelog for package shake_ros"


def _inline(text: str) -> str:
    """Markdown's code and links as those of reStructuredText."""
    return re.sub(r"\[([^\]]+)\]\(([^)]+)\)", r"`\1 <\2>`__", re.sub(r"`([^`]+)`", r"``\1``", text))


def _items(section: str) -> list[str]:
    """The bullets of a version, each one line, behind the heading that they stand under."""
    found: list[str] = []
    heading = ""
    for block in re.split(r"\n(?=- |### )|\n\n", section):
        text = " ".join(block.split())
        if text.startswith("### "):
            heading = text.removeprefix("### ")
        elif text.startswith("- "):
            found.append(f"* {heading}: {_inline(text.removeprefix('- '))}" if heading else f"* {_inline(text[2:])}")
    return found


def text() -> str:
    """The file."""
    said = ["^" * len(TITLE), TITLE, "^" * len(TITLE), ""]
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    for section in re.split(r"^## ", changes, flags=re.MULTILINE)[1:]:
        released = re.match(r"(\d+\.\d+\.\d+) – (\d{4}-\d\d-\d\d)\n", section)
        if released:
            heading = f"{released[1]} ({released[2]})"
            said += [heading, "-" * len(heading), *_items(section[released.end() :]), ""]
    return "\n".join(said)


if __name__ == "__main__":
    (ROOT / "CHANGELOG.rst").write_text(text(), encoding="utf-8")
