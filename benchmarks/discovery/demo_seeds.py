"""Is the effect that the demo hides the one it names?

    python -m benchmarks.discovery.demo_seeds [--effects N] [--save]

Runs the command `demo` once for each effect that it can hide, each time with another seed and so on another table.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import tempfile
from pathlib import Path

from shake_ros.__main__ import main as shake
from shake_ros.settings import find, read_yaml

HEAD = f"{'seed':>4}  {'hidden':<22}{'named':<46}{'held-out error before':>22}{'after':>10}{'seconds':>9}"


def one(seed: int, effect: str) -> str:
    """Run one demo; a line of the table."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        out = Path(folder) / "demo"
        code = shake(["demo", "--seed", str(seed), "--hidden", effect, "--out", str(out)])
        if code:
            return f"{seed:>4}  {effect:<22}exit code {code}"
        summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    found = summary["hidden"]
    named = found["named"] or "nothing"
    if found["alternatives"]:
        named += f" (or {', '.join(found['alternatives'])})"
    before, after = 100 * found["hold_before"], 100 * found["hold_after"]
    return f"{seed:>4}  {effect:<22}{named:<46}{before:>20.2f} %{after:>8.2f} %{summary['seconds']:>9.0f}"


def main() -> None:
    """Print the table, and keep it beside this file with --save."""
    effects = sorted(read_yaml(find("demo", "demo"))["hidden"])
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--effects", type=int, default=len(effects), help="how many hidden effects")
    parser.add_argument("--save", action="store_true", help="keep the table in demo_seeds.txt")
    given = parser.parse_args()
    lines = [HEAD]
    print(HEAD, flush=True)
    for seed, effect in enumerate(effects[: given.effects], 1):
        lines.append(one(seed, effect))
        print(lines[-1], flush=True)
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
