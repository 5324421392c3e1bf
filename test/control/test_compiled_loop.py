"""The compiled loop against the loop of objects, sample by sample and to the bit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from stepped_loop import simulate_closed_loop

from shake_ros.control.closed_loop import ClosedLoop, Loop, run_batch, simulate
from shake_ros.control.laws import CONTROLLERS, harmonic_cancellation
from shake_ros.control.laws.runner import Controller
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.control.reference.program import Program
from shake_ros.packing import numbers
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.sensors import SensorNoise, normal_draws
from shake_ros.physics.plant.table import Measurement, Table
from shake_ros.quantities import ShakeError
from shake_ros.recordings.reference_file import build_program
from shake_ros.settings import find, load_table, load_variant, read_yaml

DT, SAMPLES = 0.001, 250
KINDS = {kind: kind for kind in CONTROLLERS}


@pytest.fixture(scope="module")
def table() -> TableParameters:
    return load_table("bergamo").with_values({"effects.soft_zone.depth": 0.84, "effects.command_delay.delay": 0.0014})


@pytest.fixture(scope="module")
def program() -> Program:
    return build_program("sine_20mm_2hz", DT)


def observer(name: str, model: TableParameters) -> Observer:
    kind, parameters = load_variant("observer", name, OBSERVERS)
    return Observer(kind, parameters, DT, model)


def controller(name: str, model: TableParameters | None = None) -> Controller:
    return Controller(*load_variant("controller", name, CONTROLLERS), DT, model)


def assert_same(one: ClosedLoop, other: ClosedLoop) -> None:
    for name in ("reference", "estimate", "truth", "command", "measured"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


@pytest.mark.parametrize("name", KINDS)
def test_every_law_has_the_numbers_of_the_loop_of_objects(name: str, table: TableParameters, program: Program) -> None:
    law, estimator = controller(name), observer("linear_bergamo", table)
    compiled, finite = simulate(Loop(table, estimator, law, program.states[:SAMPLES], seed=5, delay=1, start=0.004))
    objects = simulate_closed_loop(Table(table, DT, 5), estimator, law, program, SAMPLES, delay=1, start=0.004)
    assert finite == SAMPLES
    assert_same(compiled, objects)


@pytest.mark.parametrize("name", ["model", "sliding_mode", None])
def test_model_feedforward_and_every_observer_have_them_too(
    name: str | None, table: TableParameters, program: Program
) -> None:
    law = controller("super_twisting_tuned", table)
    estimator = observer(name, table) if name else None
    compiled, _ = simulate(Loop(table, estimator, law, program.states[:SAMPLES], seed=5))
    objects = simulate_closed_loop(Table(table, DT, 5), estimator, law, program, SAMPLES)
    assert_same(compiled, objects)


class Samples:
    """A reference as it lies."""

    def __init__(self, states: np.ndarray) -> None:
        self.states = states

    def at(self, k: int) -> tuple[float, float, float]:
        x, v, a = self.states[k]
        return float(x), float(v), float(a)


class Watched(Table):
    """A table that remembers its last acceleration."""

    acceleration = 0.0

    def measure(self, state: np.ndarray, k: int) -> Measurement:
        measured = super().measure(state, k)
        self.acceleration = measured.acceleration
        return measured


class Cancelling(Controller):
    """A law with harmonics added to its reference, as the node adds them."""

    watched: Watched
    harmonics: np.ndarray
    settings: np.ndarray
    count = 0

    def step(self, state: np.ndarray, reference: Any, estimate: Any) -> tuple[np.ndarray, float]:
        self.harmonics, wanted = harmonic_cancellation.step(
            self.harmonics, self.settings, self.count * DT, np.array(reference), self.watched.acceleration
        )
        self.count += 1
        return super().step(state, wanted, estimate)


def test_harmonics_are_cancelled_in_the_loop_as_the_node_does(table: TableParameters) -> None:
    path = find("harmonic_cancellation", "default")
    cancellation = harmonic_cancellation.HarmonicCancellation.from_mapping(read_yaml(path), str(path)).replace(
        fundamental_frequency=10.0, window_periods=1, harmonics=5
    )
    omega, time = 20.0 * np.pi, np.arange(700) * DT
    states = 1e-3 * np.column_stack(
        [np.sin(omega * time), omega * np.cos(omega * time), -(omega**2) * np.sin(omega * time)]
    )
    law, estimator = controller("feedforward_pi"), observer("linear_bergamo", table)
    compiled, _ = simulate(Loop(table, estimator, law, states, seed=5, cancellation=cancellation))
    plain, _ = simulate(Loop(table, estimator, law, states, seed=5))
    cancelling = Cancelling(law.kind, law.parameters, DT)
    cancelling.watched = Watched(table, DT, 5)
    cancelling.harmonics = harmonic_cancellation.initial_state(cancellation)
    cancelling.settings = numbers(cancellation)
    objects = simulate_closed_loop(cancelling.watched, estimator, cancelling, Samples(states), len(states))
    assert_same(compiled, objects)
    assert not np.array_equal(compiled.command[-100:], plain.command[-100:])
    with pytest.raises(ShakeError, match="under a virtual table"):
        simulate(Loop(table, estimator, controller("feedforward_pi", table), states[:9], cancellation=cancellation))


def test_feedforward_computed_before_serves_another_law(table: TableParameters, program: Program) -> None:
    states = program.states[:SAMPLES]
    first, second = controller("super_twisting_tuned", table), controller("feedforward_pi_tuned", table)
    assert first.virtual is not None
    shared = first.virtual.follow(states)
    ahead, _ = simulate(Loop(table, None, second, states, feedforward=shared))
    alone, _ = simulate(Loop(table, None, second, states))
    assert_same(ahead, alone)
    with pytest.raises(ShakeError, match="feedforward of 250 samples for a reference of 249"):
        simulate(Loop(table, None, second, states[:-1], feedforward=shared))


def test_a_batch_keeps_the_order_and_tells_its_progress(table: TableParameters, program: Program) -> None:
    loops = [Loop(table, None, controller("none"), program.states[:20], start=0.001 * i) for i in range(5)]
    counts: list[int] = []
    starts = run_batch(loops, lambda i, run: (i, float(run.truth[0, 0])), counts.append)
    assert starts == [(i, 0.001 * i) for i in range(5)]
    assert counts == [1, 2, 3, 4, 5]


def test_rows_behind_a_lost_sample_are_not_a_number(table: TableParameters, program: Program) -> None:
    reference = program.states[:SAMPLES].copy()
    reference[100, 0] = np.nan
    run, finite = simulate(Loop(table, None, controller("feedforward_pi"), reference))
    assert finite == 100
    assert np.isfinite(run.truth[:100]).all()
    assert np.isnan(run.truth[100:]).all()


def test_draws_of_many_samples_are_those_of_single_ones() -> None:
    parameters = load_table("bergamo").sensors
    noise, draws = SensorNoise(parameters, 11), normal_draws(11, 4100)
    for k in (0, 4095, 4096, 4099):
        assert noise.read(k, 0.0, 0.0, 0.0, 0.0, 0.0)[4] == parameters.pressure_noise * draws[k, 4]


def test_different_sample_times_are_refused(table: TableParameters, program: Program) -> None:
    estimator = Observer(*load_variant("observer", "linear_bergamo", OBSERVERS), 0.002)
    with pytest.raises(ShakeError, match="sample times"):
        simulate(Loop(table, estimator, controller("none"), program.states[:10]))
