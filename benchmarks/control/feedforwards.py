"""What of a law is its feedforward: three laws, each with two feedforwards.

    python -m benchmarks.control.feedforwards [--save]

The plant of `compare`, no model feedforward. Feedback of feedforward PI, sliding mode and super-twisting, each under

    velocity       K v_ref
    reduced model  u of β_3 u + |u| (β_4 a_ref + β_5 v_ref) = −β_1 v_ref − β_2 a_ref, as (6.49) has it of the reference

and tuned under it by the functional of `tune`, on its references and loads, from the configurations of `compare`.
Sliding mode loses its own valve losses with the former and has them from the estimate with the latter; its equivalent
control's feedback stays. Position error by load, mean over the references, and travel of the command. --save writes
benchmarks/control/feedforwards.txt.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from shake_ros.api.loops import Combination, Setup, load_setup
from shake_ros.api.tune import Cost, gains_of, rounded
from shake_ros.api.tune_table import text_of
from shake_ros.core.control import CONTROLLERS
from shake_ros.core.control.closed_loop import tune
from shake_ros.core.control.runner import Controller
from shake_ros.core.loop.compiled import Loop, run_batch
from shake_ros.core.loop.metrics import judge
from shake_ros.settings import find, load_variant, read_yaml

OBSERVER = "linear_soft_zone"
LAWS = {
    "feedforward PI": "feedforward_pi_soft_zone",
    "sliding mode": "sliding_mode_soft_zone",
    "super-twisting": "super_twisting_soft_zone",
}
FEEDFORWARDS = ("velocity", "reduced model")
LEAST_GAIN = 0.2  # share of β_3 below which the valve's gain is not let fall, as in the law
REFERENCES = ("earthquake_stiff_soil", "sine_20mm_2hz", "earthquake_rock")  # that are tuned on


def commands(feedforward: str, beta: Any, gain: float, states: np.ndarray) -> np.ndarray:
    """Feedforward (n,) [-] along a reference (n, 3)."""
    velocity, acceleration = states[:, 1], states[:, 2]
    if feedforward == "velocity":
        return gain * velocity
    demand = -beta.beta1 * velocity - beta.beta2 * acceleration
    loss = beta.beta4 * acceleration + beta.beta5 * velocity
    return demand / np.maximum(beta.beta3 + np.sign(demand) * loss, LEAST_GAIN * beta.beta3)


def under(feedforward: str, law: str, parameters: Any, beta: Any) -> Callable[[Loop], Loop]:
    """Puts the feedforward into a loop; sliding mode takes the reduced model's of itself."""
    if law == "sliding mode" and feedforward == "reduced model":
        return lambda loop: loop
    gain = abs(getattr(parameters, "feedforward_gain", beta.beta1 / beta.beta3))

    def change(loop: Loop) -> Loop:
        return replace(loop, feedforward=(commands(feedforward, beta, gain, loop.reference), loop.reference))

    return change


def row(setup: Setup, settings: dict[str, Any], label: str, feedforward: str, folder: Path) -> str:
    """A law tuned under a feedforward, and what it does."""
    _, beta = load_variant("controller", LAWS["sliding mode"], CONTROLLERS)
    kind, parameters = load_variant("controller", LAWS[label], CONTROLLERS)
    if label == "sliding mode" and feedforward == "velocity":
        parameters = parameters.replace(beta4=0.0, beta5=0.0)
    path = folder / "law.yaml"
    path.write_text(text_of(kind, parameters, []), encoding="utf-8")
    change = under(feedforward, label, parameters, beta)
    fixed = [*settings["fixed"], "feedforward_gain"]
    cost = Cost(setup, settings, str(path), change)
    found, _ = tune(gains_of(parameters, fixed), cost, evaluations=settings["evaluations"])
    gains = rounded(found)
    law = Controller(kind, parameters.replace(**gains), setup.sample_time)
    courses, loads = setup.courses(setup.settings["references"]), setup.settings["loads"]
    entry, delay = Combination("", str(path), OBSERVER, "none"), int(setup.settings["delay"])
    cases = [(c, load) for load in loads for c in courses]
    loops = [replace(change(setup.loop(entry, c, load, setup.table(load), delay)), controller=law) for c, load in cases]
    stroke = loops[0].table.body.stroke
    found_metrics = run_batch(loops, lambda i, run: judge(run, cases[i][0].part, 1.0, stroke))
    line = f"{label:15s}  {feedforward:13s}  {cost(gains):6.4f}"
    for name, scale in (("position_error", 100.0), ("command_travel", 1.0)):
        values = np.array([getattr(m, name) for m in found_metrics]).reshape(len(loads), -1).mean(axis=1)
        line += "  " + "".join(f"{scale * v:6.2f}" for v in values)
    return line + f"  {sum(m.unstable for m in found_metrics):8d}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--save", action="store_true")
    arguments = parser.parse_args()
    began = time.perf_counter()
    setup = load_setup("default")
    settings = {**read_yaml(find("tune", "default")), "references": list(REFERENCES)}
    lines = [f"{'law':15s}  {'feedforward':13s}    cost   position [%] of loads   travel [1/s] of loads  unstable"]
    print(lines[0])
    with tempfile.TemporaryDirectory() as folder:
        for label in LAWS:
            for feedforward in FEEDFORWARDS:
                lines.append(row(setup, settings, label, feedforward, Path(folder)))
                print(lines[-1], flush=True)
    lines.append(f"in {time.perf_counter() - began:.0f} s")
    if arguments.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
