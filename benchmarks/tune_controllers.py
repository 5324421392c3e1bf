"""Tuning of the `_tuned` controllers and observers: python benchmarks/tune_controllers.py [KIND …] [--evaluations N].

Minimises the functional (6.42), with a price on the command's travel, over the table bergamo with each of seven effects
that the controller does not know, on the first three seconds of the earthquake reference; the linear observer with
the table's β, sensor noise and steps, one sample of delay. Prints the gains to be written into config/controller/.
`observer` as KIND prints the boundary layers of config/observer/sliding_mode_tuned.yaml. About five minutes a law.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from shake_ros.core.control import CONTROLLERS  # noqa: E402
from shake_ros.core.control.closed_loop import ClosedLoop, simulate_closed_loop  # noqa: E402
from shake_ros.core.control.runner import Controller  # noqa: E402
from shake_ros.core.control.tuning import tune  # noqa: E402
from shake_ros.core.observer import OBSERVERS  # noqa: E402
from shake_ros.core.observer.linear import kalman_gain  # noqa: E402
from shake_ros.core.observer.runner import Observer  # noqa: E402
from shake_ros.core.plant.table import Table  # noqa: E402
from shake_ros.data.reference_program import build_program  # noqa: E402
from shake_ros.settings import load_table, load_variant  # noqa: E402

SAMPLE_TIME = 0.001
SAMPLES = 3000
TRAVEL_PRICE = 0.004  # [s]
EFFECTS: dict[str, dict[str, float]] = {
    "none": {},
    "spool_deadband": {"effects.spool_deadband.width": 0.03},
    "valve_null_shift": {"effects.valve_null_shift.offset": 0.03},
    "asymmetric_flow_gain": {"effects.asymmetric_flow_gain.asymmetry": 0.2},
    "soft_zone": {"effects.soft_zone.depth": 0.8},
    "payload_error": {"effects.payload_error.mass": 300.0},
    "command_delay": {"effects.command_delay.delay": 0.004},
}
SURFACE = ("surface_integral", "surface_position", "surface_velocity")
TUNED = {
    "feedforward_pi": ("proportional_gain", "integral_gain", "feedforward_gain"),
    "sliding_mode": (*SURFACE, "reaching_gain", "reaching_slope"),
    "super_twisting": (*SURFACE, "root_gain", "root_slope", "twisting_gain", "feedforward_gain"),
}


def cases(kind: str) -> list[Callable[[dict[str, float]], ClosedLoop]]:
    """One closed loop per effect, as a function of the gains."""
    base, program = load_table("bergamo"), build_program("earthquake", SAMPLE_TIME)
    name, parameters = load_variant("observer", "linear_bergamo", OBSERVERS)
    observer = Observer(name, parameters, SAMPLE_TIME)
    _, start = load_variant("controller", f"{kind}_tuned", CONTROLLERS)

    def case(effect: str) -> Callable[[dict[str, float]], ClosedLoop]:
        table = Table(base.with_values(EFFECTS[effect]), SAMPLE_TIME, seed=3)

        def run(gains: dict[str, float]) -> ClosedLoop:
            law = Controller(kind, start.replace(**gains), SAMPLE_TIME)
            return simulate_closed_loop(table, observer, law, program, SAMPLES, delay=1)

        return run

    return [case(effect) for effect in EFFECTS]


def boundary_layers(jerk_noise: float, gains: tuple[float, float, float]) -> tuple[float, float, float]:
    """Boundary layers within which the sliding-mode observer with λ = `gains` has the Kalman filter's gain."""
    _, parameters = load_variant("observer", "linear_bergamo", OBSERVERS)
    first, second, third, _ = kalman_gain(
        parameters.replace(jerk_noise=jerk_noise, disturbance_noise=1e-3), SAMPLE_TIME
    )
    lambda1, lambda2, lambda3 = gains
    return (
        lambda1 * SAMPLE_TIME * (1.0 / first - 1.0),
        lambda2 * (first / second - SAMPLE_TIME),
        lambda3 * (second / third - SAMPLE_TIME),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", choices=[*TUNED, "observer"], metavar="KIND")
    parser.add_argument("--evaluations", type=int, default=120)
    arguments = parser.parse_args()
    for kind in arguments.kinds or [*TUNED, "observer"]:
        if kind == "observer":
            print("sliding_mode_tuned: boundary layers", np.round(boundary_layers(9.0, (0.3, 20.0, 2000.0)), 6))
            continue
        _, parameters = load_variant("controller", f"{kind}_tuned", CONTROLLERS)
        start = {name: float(getattr(parameters, name)) for name in TUNED[kind]}
        gains, cost = tune(start, cases(kind), travel_price=TRAVEL_PRICE, evaluations=arguments.evaluations)
        print(f"{kind}: cost {cost:.4f}", {name: float(f"{value:.4g}") for name, value in gains.items()}, flush=True)


if __name__ == "__main__":
    main()
