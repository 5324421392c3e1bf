"""The notebooks, and what they import, where the manual runs them."""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "examples"


def pages() -> dict[str, str]:
    """Each notebook as it stands; the build executes it."""
    files = [*FOLDER.glob("*.ipynb"), FOLDER / "laboratory.py"]
    return {f"examples/{path.name}": path.read_text(encoding="utf-8") for path in files}
