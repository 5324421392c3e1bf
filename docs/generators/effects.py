"""The listed effects: what each is, its parameters and its figure, from the table EFFECTS."""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
import subprocess
import sys
from pathlib import Path
from typing import Any

from shake_ros.physics.effects import EFFECTS, PLACES

ROOT = Path(__file__).resolve().parents[2]


def parameters(effect: Any) -> list[str]:
    """Rows of the effect's parameters."""
    rows = ["| parameter | unit | range | absent or usual | meaning |", "|---|---|---|---|---|"]
    for field in dataclasses.fields(effect):
        if field.name.startswith("node_"):
            continue
        data = field.metadata
        bounds = f"{data['low']:g} … {data['high']:g}" if "low" in data and "high" in data else ""
        rows.append(f"| `{field.name}` | {data['unit']} | {bounds} | {field.default:g} | {data['meaning']} |")
    return rows


def entry(name: str, effect: Any) -> list[str]:
    """What its docstring says, its parameters."""
    text = inspect.getdoc(effect) or ""
    depends = ", ".join(effect.depends_on) or "nothing in particular"
    models = ", ".join(f"`{model}`" for model in effect.models)
    return [f"### `{name}`", "", text, "", f"Depends on {depends}; models {models}.", "", *parameters(effect), ""]


def pages() -> dict[str, str]:
    """One page, place by place."""
    text = [
        "# Effects",
        "",
        "Every effect that a declared model may lack, as its class describes it. What each looks like",
    ]
    text += ["in a recording is described under [Effects and what they look like](../../explanation/effects.md).", ""]
    for place in PLACES:
        named = {name: effect for name, effect in EFFECTS.items() if effect.place == place}
        if named:
            text += [f"## {place.capitalize()}", ""]
            for name, effect in named.items():
                text += entry(name, effect)
    return {"effects.md": "\n".join(text)}


def draw(folder: Path) -> None:
    """Every figure that `./shake figures` draws, again only where a source or a configuration has changed."""
    sources = sorted([*(ROOT / "shake_ros").rglob("*.py"), *(ROOT / "config").rglob("*.yaml")])
    key = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()
    drawn = folder / "drawn"
    if drawn.exists() and drawn.read_text(encoding="utf-8") == key:
        return
    command = [sys.executable, "-m", "shake_ros", "figures", "all", "--out", str(folder), "--force"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    drawn.write_text(key, encoding="utf-8")
