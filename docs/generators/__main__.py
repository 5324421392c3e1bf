"""Writes every generated page: `python docs/generators FOLDER [--figures]`, with ROS absent or put aside."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from docs.generators import commands, configuration, effects, examples, house, nodes, python, topics


def main() -> None:
    """Replace the folder's pages by those of the code as it stands; its figures are kept while they hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--figures", action="store_true", help="draw the figures too (a minute)")
    arguments = parser.parse_args()
    sys.meta_path.insert(0, nodes.StandIns())
    for old in arguments.folder.rglob("*.md"):
        old.unlink()
    for part in (topics, configuration, commands, effects, examples, house, python, nodes):
        for name, text in part.pages().items():
            path = arguments.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
    if arguments.figures:
        effects.draw(arguments.folder / "figures")


main()
