"""The house in a picture: which folder of shake_ros/ imports which, read from the sources, as an SVG."""

from __future__ import annotations

import ast
import runpy
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "shake_ros"
WIDTH, ROW, BOX, MARGIN = 860, 74, 34, 16
STYLE = """text{font:13px system-ui,sans-serif;fill:#1f2933}rect{fill:#e8eef6;stroke:#5b7aa6;rx:6}
path{fill:none;stroke:#5b7aa6;stroke-opacity:.35}.ground{fill:#fff;stroke:none}"""


def layers() -> tuple[tuple[str, ...], ...]:
    """The layers that test/test_architecture.py holds, from the bottom up."""
    found: tuple[tuple[str, ...], ...] = runpy.run_path(str(ROOT / "test" / "test_architecture.py"))["LAYERS"]
    return found


def group(module: str, known: set[str]) -> str:
    """The layer group of a dotted name behind `shake_ros.`, empty where there is none."""
    parts = module.split(".")[1:]
    return next((name for n in (2, 1) if (name := ".".join(parts[:n])) in known), "")


def arrows(known: set[str]) -> set[tuple[str, str]]:
    """Pairs (importer, imported) of groups."""
    found = set()
    for path in PACKAGE.rglob("*.py"):
        own = group(".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"), known)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            others = {group(name, known) for name in names if name.startswith("shake_ros.")}
            found |= {(own, other) for other in others if own and other and own != other}
    return found


def svg() -> str:
    """Layers as rows, the highest on top; a line for every import from one group to another."""
    rows = [row for row in reversed(layers()) if row]
    place: dict[str, tuple[float, float]] = {}
    for line, row in enumerate(rows):
        for column, name in enumerate(row):
            place[name] = ((column + 0.5) * WIDTH / len(row), MARGIN + line * ROW + BOX / 2)
    height = 2 * MARGIN + (len(rows) - 1) * ROW + BOX
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" role="img">']
    parts += [f"<title>Imports between the folders of shake_ros</title><style>{STYLE}</style>"]
    parts += [f'<rect class="ground" width="{WIDTH}" height="{height}"/>']
    for own, other in sorted(arrows(set(place))):
        (x, y), (u, v) = place[own], place[other]
        middle = (y + v) / 2
        parts.append(f'<path d="M{x:.0f} {y:.0f}C{x:.0f} {middle:.0f} {u:.0f} {middle:.0f} {u:.0f} {v:.0f}"/>')
    for name, (x, y) in place.items():
        wide = 7.4 * len(name) + 18
        parts.append(f'<rect x="{x - wide / 2:.0f}" y="{y - BOX / 2:.0f}" width="{wide:.0f}" height="{BOX}"/>')
        parts.append(f'<text x="{x:.0f}" y="{y + 4.5:.0f}" text-anchor="middle">{name}</text>')
    return "\n".join([*parts, "</svg>", ""])


def pages() -> dict[str, str]:
    """The picture alone."""
    return {"house.svg": svg()}
