"""The pages of msg_docs/, one per topic, and the list of equations, taken into the manual."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def pages() -> dict[str, str]:
    """Every page as it stands, its links of the form ../docs/… turned to their place here."""
    text = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / "msg_docs").glob("*.md")}
    found = {f"topics/{name}.md": page.replace("](../docs/", "](../../../") for name, page in text.items()}
    names = "\n".join(sorted(name for name in text if name != "README"))
    found["topics/README.md"] += f"\n```{{toctree}}\n:hidden:\n\n{names}\n```\n"
    return {**found, "equations.md": (ROOT / "shake_ros" / "physics" / "EQUATIONS.md").read_text(encoding="utf-8")}
