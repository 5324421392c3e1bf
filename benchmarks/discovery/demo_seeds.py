"""Is the effect that the demo hides the one it names?

    python -m benchmarks.discovery.demo_seeds [--effects N] [--save]

For one seed of each hidden effect: the loop over DDS in lock-step as separate processes, excitation and earthquake
recorded, the missing effect searched, as the demo does it (its steps 2 and 3, `shake_ros/cli/demo.py`).
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from shake_ros.cli import demo
from shake_ros.cli.progress import Bar
from shake_ros.data.recordings import read_table_recording
from shake_ros.settings import find, read_yaml, save_table

HEAD = f"{'seed':>4}  {'hidden':<22}{'named':<46}{'held-out error before':>22}{'after':>10}{'seconds':>9}"


def seeds_of_effects(settings: dict[str, object], count: int) -> dict[str, int]:
    """The first seed that hides each effect, for `count` effects."""
    first: dict[str, int] = {}
    seed = 1
    while len(first) < count:
        first.setdefault(demo.hide(settings, seed, None).effect, seed)
        seed += 1
    return first


def one(settings: dict[str, object], seed: int) -> str:
    """Run one seed; a line of the table."""
    started = time.monotonic()
    hidden = demo.hide(settings, seed, None)
    with tempfile.TemporaryDirectory() as folder, Bar(f"seed {seed}") as bar:
        work = Path(folder)
        save_table(work / "hidden_table.yaml", hidden.table, "simulated table")
        recordings = {}
        for name in ("excitation", "earthquake"):
            bag = demo.record_run(work, name, settings, hidden, str(settings["declared"]), bar)
            recordings[name] = read_table_recording(bag)
        result, _, _ = demo.close(settings, recordings, bar)
    steps = result.search.steps
    named = " + ".join(
        s.chosen.candidate.effect + (f" (or {', '.join(s.alternatives)})" if s.alternatives else "") for s in steps
    )
    before, after = demo.mean_error(result.baseline.validation), demo.mean_error(result.final.validation)
    return (
        f"{seed:>4}  {hidden.effect:<22}{named or 'nothing':<46}{100 * before:>20.2f} %{100 * after:>8.2f} %"
        f"{time.monotonic() - started:>9.0f}"
    )


def main() -> None:
    """Print the table, and keep it beside this file with --save."""
    parser = argparse.ArgumentParser(description=__doc__)
    settings = read_yaml(find("demo", "demo"))
    parser.add_argument("--effects", type=int, default=len(settings["hidden"]), help="how many hidden effects")
    parser.add_argument("--save", action="store_true", help="keep the table in demo_seeds.txt")
    given = parser.parse_args()
    lines = [HEAD]
    print(HEAD, flush=True)
    for seed in seeds_of_effects(settings, min(given.effects, len(settings["hidden"]))).values():
        lines.append(one(settings, seed))
        print(lines[-1], flush=True)
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
