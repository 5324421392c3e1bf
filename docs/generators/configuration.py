"""Every file of config/, one page per folder, and one of the kinds that have a single file."""

from __future__ import annotations

from pathlib import Path

CONFIG = Path(__file__).resolve().parents[2] / "config"


def first_comment(path: Path) -> str:
    """What the file says about itself in its first line, empty where it starts with data."""
    line = path.read_text(encoding="utf-8").splitlines()[0]
    return line.lstrip("# ").strip() if line.startswith("#") else ""


def page(folder: Path) -> str:
    """The folder's files, each as it stands."""
    text = [f"# `{folder.relative_to(CONFIG.parent)}`", ""]
    for path in sorted(folder.glob("*.yaml")):
        text += [f"## `{path.stem}`", ""]
        text += [f"```{{literalinclude}} ../../../../{path.relative_to(CONFIG.parent)}", ":language: yaml", "```", ""]
    return "\n".join(text)


def pages() -> dict[str, str]:
    """One page per folder, and their list."""
    folders = [CONFIG, *sorted(path for path in CONFIG.iterdir() if path.is_dir())]
    rows = ["| folder | files |", "|---|---|"]
    for folder in folders:
        names = ", ".join(f"`{path.stem}`" for path in sorted(folder.glob("*.yaml")))
        rows.append(f"| [{folder.name}](configuration/{folder.name}.md) | {names} |")
    table = "\n".join(rows) + "\n"
    tree = "\n".join(["", "```{toctree}", ":hidden:", "", *(f"configuration/{f.name}" for f in folders), "```", ""])
    return {
        "configuration_list.md": f"# Configuration files, folder by folder\n\n{table}{tree}",
        **{f"configuration/{folder.name}.md": page(folder) for folder in folders},
    }
