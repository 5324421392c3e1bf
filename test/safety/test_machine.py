"""The machine under plant and emulator: what its faults do to oil, spool and readings."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from shake_ros.safety.causes import HIGH, LOW, OFF, RUN
from shake_ros.safety.faults import BIASED, FROZEN, MACHINE_FAULTS, MISSING, NOISY, MachineFaultParameters
from shake_ros.safety.machine import Machine, PowerUnitParameters
from shake_ros.settings import load_table

SAMPLE_TIME = 1e-3
LAG = 0.1  # of the power unit [s]


@pytest.fixture
def machine() -> Machine:
    return Machine(load_table("bergamo"), PowerUnitParameters(50e5, LAG), SAMPLE_TIME, 1, 0.0, RUN)


def run(machine: Machine, samples: int, u: float, stage: int = RUN) -> float:
    """Distance moved [m]."""
    before = machine.measure().truth_position
    for _ in range(samples):
        machine.advance(stage, u)
    return machine.measure().truth_position - before


def test_every_switch_of_a_node_is_a_fault_and_every_fault_has_a_switch() -> None:
    switches = {field.name for field in dataclasses.fields(MachineFaultParameters)}
    assert switches == {*MACHINE_FAULTS, "valve_opening"}
    assert not MachineFaultParameters().on()


def test_pressure_of_a_failed_supply_decays_whatever_is_asked_for_and_is_confirmed_no_more(machine) -> None:
    high = machine.unit.high_pressure
    assert machine.confirmed() == HIGH
    machine.on = {"supply_failure": 1.0}
    run(machine, round(LAG / SAMPLE_TIME), 0.0)
    tank = machine.unit.tank_pressure
    assert machine.unit.pressure == pytest.approx(tank + (high - tank) / math.e, rel=1e-9)
    assert machine.confirmed() == LOW
    run(machine, 1000, 0.0)
    assert machine.confirmed() == OFF
    machine.on = {}
    run(machine, 1000, 0.0)
    assert machine.confirmed() == HIGH


def test_stuck_spool_moves_the_table_on_and_a_free_one_does_not(machine) -> None:
    run(machine, 100, 0.1)
    machine.on = {"valve_stuck": 1.0}
    stuck = run(machine, 200, 0.0)
    assert machine.acting == 0.1
    machine.on = {}
    run(machine, 50, 0.0)
    assert abs(run(machine, 200, 0.0)) < 0.05 * stuck  # what leaks


def test_spool_that_is_stuck_at_an_opening_goes_there(machine) -> None:
    machine.on = {"valve_stuck_at": -0.2}
    assert run(machine, 300, 0.5) < -0.02 and machine.acting == -0.2


@pytest.mark.parametrize("fault", [*MISSING, *FROZEN, *BIASED, *NOISY])
def test_fault_of_a_sensor_changes_its_own_reading_alone_and_never_the_truth(fault) -> None:
    field = {**MISSING, **FROZEN, **BIASED, **NOISY}[fault]
    healthy, faulty = (
        Machine(load_table("bergamo"), PowerUnitParameters(50e5, LAG), SAMPLE_TIME, 1, 0.0, RUN) for _ in range(2)
    )
    faulty.on = {fault: 0.5}
    right, wrong = [], []
    for _ in range(50):
        for one, read in ((healthy, right), (faulty, wrong)):
            one.advance(RUN, 0.1)
            read.append(one.measure()._asdict())
    values = [one.pop(field) for one in right]
    held = [one.pop(field) for one in wrong]
    assert wrong == right
    if fault in MISSING:
        assert all(math.isnan(one) for one in held)
    elif fault in FROZEN:
        assert set(held) == {values[0]}
    elif fault in BIASED:
        assert held == [one + 0.5 for one in values]
    else:
        assert 0.3 < np.std(np.subtract(held, values)) < 0.7
    faulty.on = {}
    for one in (healthy, faulty):
        one.advance(RUN, 0.1)
    assert faulty.measure() == healthy.measure()
