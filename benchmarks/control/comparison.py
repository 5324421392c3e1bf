"""The whole comparison of the controllers, timed: python -m benchmarks.control.comparison [--save].

Runs `compare` with each of its settings into a temporary folder and prints what it prints: the table with the soft
zone, and one under a specimen that sways. --save writes benchmarks/control/comparison.txt.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import sys
import tempfile
from pathlib import Path

from shake_ros.__main__ import main as shake

SETTINGS = ("default", "specimen")  # of config/compare; `thesis` is run by `reproduce controllers`


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--save", action="store_true")
    arguments = parser.parse_args()
    printed = io.StringIO()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(printed):
        code = max(shake(["compare", "--settings", name, "--out", str(Path(folder) / name)]) for name in SETTINGS)
    lines = [line for line in printed.getvalue().splitlines() if not line.startswith("report:")]
    text = "\n".join(lines) + "\n"
    print(text, end="")
    if arguments.save and code == 0:
        Path(__file__).with_suffix(".txt").write_text(text, encoding="utf-8")
    return code


if __name__ == "__main__":
    sys.exit(main())
