"""What stands between a command and the valve: stages, holds, trips, resets."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest

from shake_ros.quantities import ShakeError
from shake_ros.safety import causes as sensors
from shake_ros.safety.causes import ACTIONS, CAUSES, HIGH, HYDRAULIC, LOW, OFF, RUN, InterlockParameters
from shake_ros.safety.interlock import ERROR, OK, WARN, Interlock
from shake_ros.settings import find, load_interlock, read_yaml

MS = 1_000_000
SUPPLY = 206e5


def parameters(name: str = "simulation", causes: dict[str, dict[str, Any]] | None = None, **changes: Any):
    """A configured interlock with a few values changed."""
    configured = load_interlock(name)
    for cause, values in (causes or {}).items():
        response = configured.response(cause).replace(**values)
        configured = configured.replace(causes=dataclasses.replace(configured.causes, **{cause: response}))
    return configured.replace(**changes)


@pytest.fixture
def lock() -> Interlock:
    """Stale after 10 ms, ramp of 100 ms, a command of 0.5 at 0."""
    made = Interlock(parameters(causes={"stale_command": {"threshold": 0.01}}, ramp_time=0.1), enabled=True)
    made.command(0, 0.5)
    return made


def running(name: str = "bergamo", **causes: dict[str, Any]) -> Interlock:
    """A real table's interlock at the stage `run` at full span, at 10 s."""
    made = Interlock(parameters(name, causes), enabled=False)
    made.enable(True)
    for k in range(10_000):
        made.observe(k * MS, 1e-5 * (-1) ** k, 0.01 * (-1) ** k, SUPPLY)
        made.command(k * MS, 0.01)
        made.act(k * MS)
    assert made.stage == RUN and made.gain == 1.0
    return made


def test_first_sample_finds_the_look_at_it_compiled(monkeypatch) -> None:
    asked = []
    monkeypatch.setattr(sensors, "watch", lambda *given: asked.append([type(one) for one in given]) or 0)
    made = Interlock(parameters("bergamo"), enabled=True)
    made.observe(MS, 0.0, 0.0, SUPPLY)
    prepared, first = asked
    assert prepared == first


def test_fresh_command_acts(lock) -> None:
    assert lock.act(5 * MS) == 0.5
    assert lock.condition() == (OK, "running")


def test_command_beyond_full_opening_is_clipped_and_said(lock) -> None:
    lock.command(1 * MS, -7.0)
    assert lock.act(1 * MS) == -1.0
    assert lock.condition() == (WARN, "running; command_range 7 beyond 1")
    lock.command(2 * MS, -0.5)
    assert lock.condition() == (OK, "running")


def test_stale_command_ramps_to_zero_and_stays(lock) -> None:
    lock.act(10 * MS)
    ramp = [lock.act(t * MS) for t in range(11, 100)]
    assert ramp[0] == pytest.approx(0.49)
    assert all(after <= before for before, after in itertools.pairwise(ramp))
    assert ramp[-1] == 0.0
    level, text = lock.condition()
    assert level == ERROR and text == "safe hold: no command for 0.099 s"
    assert lock.holds == 1


def test_hold_ends_with_a_fresh_command(lock) -> None:
    lock.act(200 * MS)
    lock.command(200 * MS, 0.3)
    assert lock.act(201 * MS) == 0.3


def test_two_commanders_hold_in_spite_of_fresh_commands_until_reset(lock) -> None:
    lock.report(0, "two_commanders", 2.0, "two publishers", stands=False)
    for t in range(200):
        lock.command(t * MS, 0.5)
        held = lock.act(t * MS)
    assert held == 0.0
    assert lock.condition() == (ERROR, "safe hold: two publishers")
    assert lock.reset()[0]
    assert lock.act(200 * MS) == 0.5


def test_reset_is_refused_with_its_reason_while_the_cause_stands(lock) -> None:
    lock.report(0, "two_commanders", 2.0, "2 publishers")
    assert lock.reset() == (False, "2 publishers still stands")
    lock.clear("two_commanders")
    assert lock.reset() == (True, "running")


@pytest.mark.parametrize("hold", ["stopped", "not enabled", "no command yet"])
def test_nothing_acts_when_stopped_disabled_or_before_the_first_command(lock, hold) -> None:
    if hold == "stopped":
        lock.stop(0)
    else:
        lock = Interlock(parameters(), enabled=hold == "no command yet")
    assert lock.act(1 * MS) == 0.0
    assert lock.condition()[0] != OK


def test_stop_takes_the_valve_to_null_and_the_pressure_off_at_once_and_reset_starts_a_simulation_again(lock) -> None:
    assert lock.act(1 * MS) == 0.5
    lock.stop(2 * MS)
    assert (lock.act(2 * MS), lock.stage) == (0.0, OFF)
    assert lock.condition() == (WARN, "stopped; waiting for reset")
    lock.command(3 * MS, 0.4)
    assert lock.act(3 * MS) == 0.0
    lock.reset()
    assert (lock.act(4 * MS), lock.stage) == (0.4, RUN)


def test_real_table_starts_through_its_stages_in_their_times_and_ramps_the_span() -> None:
    lock = Interlock(load_interlock("bergamo"), enabled=False)
    assert lock.condition() == (WARN, "not enabled")
    lock.enable(True)
    reached, gains = {}, []
    for k in range(5000):
        lock.command(k * MS, 0.5)
        u = lock.act(k * MS)
        reached.setdefault(lock.stage, k)
        gains.append(lock.gain)
        assert u == lock.gain * 0.5
        assert (u == 0.0) or lock.stage == RUN
    assert reached == {LOW: 0, HIGH: 2000, RUN: 3000}
    assert np.diff(gains).max() == pytest.approx(1e-3) and gains[-1] == 1.0
    lock.enable(False)
    assert lock.act(5000 * MS) == pytest.approx(0.5 - 1.0 / 50.0)  # the motion ramps first
    stages = [RUN if lock.act(k * MS) else lock.stage for k in range(5001, 8000)]
    assert stages[0] == RUN and stages[150] == LOW and stages[-1] == OFF


def test_start_waits_until_the_hydraulics_confirm_each_stage() -> None:
    lock = Interlock(load_interlock("bergamo"), enabled=False)
    lock.enable(True)
    for k in range(9000):
        lock.act(k * MS, confirmed=OFF)
    assert lock.stage == LOW
    for k in range(9000, 18000):
        lock.act(k * MS, confirmed=LOW)
    assert lock.stage == HIGH


SENSED_FAULTS = {
    "position_soft": lambda k: (0.12, 0.0, SUPPLY),
    "position_hard": lambda k: (0.127, 0.0, SUPPLY),
    "velocity": lambda k: (2e-3 * k, 0.0, SUPPLY),
    "acceleration": lambda k: (0.0, 61.0, SUPPLY),
    "sensor_frozen": lambda k: (0.001, 1e-3 * k, SUPPLY),
    "sensor_jump": lambda k: (0.006 * (k % 2), 0.0, SUPPLY),
    "sensor_implausible": lambda k: (1e-6 * (k % 2), 20.0, SUPPLY),
    "valve_implausible": lambda k: (1e-6 * (k % 2), 0.01 * (k % 2), SUPPLY),
    "supply_pressure_low": lambda k: (1e-6 * (k % 2), 0.01 * (k % 2), 90e5),
    "sensor_missing": lambda k: (math.nan, 0.01 * (k % 2), SUPPLY),
}


@pytest.mark.parametrize("cause", SENSED_FAULTS)
def test_each_cause_of_the_sensors_trips_with_time_value_and_limit(cause) -> None:
    others = {name: {"action": "none"} for name in SENSED_FAULTS if name != cause}
    lock = running(**others, **{cause: {"action": HYDRAULIC}})
    for k in range(10_000, 10_200):
        lock.command(k * MS, 0.3)
        lock.observe(k * MS, *SENSED_FAULTS[cause](k - 10_000))
        lock.act(k * MS)
        if lock.trips:
            break
    (trip,) = lock.trips
    response = lock.parameters.response(cause)
    assert (trip.cause, trip.time, trip.action, trip.limit) == (cause, k * MS, HYDRAULIC, response.threshold)
    assert trip.value < trip.limit if CAUSES[cause].below else trip.value > trip.limit
    assert lock.stage == OFF and lock.act(k * MS) == 0.0
    assert cause in lock.condition()[1] and lock.condition()[0] == ERROR


def test_tracking_error_holds_and_reset_lets_it_come_back() -> None:
    lock = running(tracking_error={"action": "program_hold"})
    lock.observe(10_000 * MS, 0.0, 0.0, SUPPLY, reference=0.05)
    lock.act(10_000 * MS)
    assert lock.condition()[1] == "safe hold: tracking_error 0.05 beyond 0.01 m; waiting for reset"
    assert lock.stage == RUN
    lock.observe(10_001 * MS, 0.0, 0.0, SUPPLY, reference=0.049)
    assert lock.reset()[0]
    lock.command(10_001 * MS, 0.2)
    lock.act(10_002 * MS)
    assert 0.0 < lock.act(10_003 * MS) < 0.2  # softly


@pytest.mark.parametrize(("back", "watched_after"), [(0.5, None), (3.0, None), (9.0, "return"), (-0.5, "back")])
def test_tracking_error_is_watched_once_the_table_has_come_back_or_has_had_the_time(back, watched_after) -> None:
    """Back so long after full span [s]; negative: only for a moment, so long before the end of `return_time`."""
    lock = running(position_soft={"action": "none"})
    p = lock.parameters
    full = 10_200 + round(1000 * p.span_time)
    over = full + round(1000 * p.return_time)
    came = full + round(1000 * back) if back > 0.0 else over + round(1000 * back)
    lock.report(10_000 * MS, "command_jump", 1.0, stands=False)
    for k in range(10_000, over + 1000):
        if k == 10_200:
            assert lock.reset()[0]
        near = k == 10_000 or (k >= came if back > 0.0 else k == came)
        lock.observe(k * MS, 1e-5 * (-1) ** k, 0.01 * (-1) ** k, SUPPLY, reference=0.001 if near else 0.05)
        lock.command(k * MS, 0.01)
        lock.act(k * MS)
    tripped = [trip.time / MS for trip in lock.trips if trip.cause == "tracking_error"]
    expected = {None: [], "return": [over + 1], "back": [came + 1]}[watched_after]
    assert tripped == pytest.approx(expected, abs=1.5)


def test_command_lost_takes_the_pressure_off_and_needs_reset_and_enable() -> None:
    lock = running()
    for k in range(10_000, 10_300):
        lock.act(k * MS)
    assert [trip.cause for trip in lock.trips] == ["stale_command", "command_lost"]
    assert lock.stage == OFF and lock.trips[1].time == 10_200 * MS
    assert lock.condition()[1].startswith("hydraulic interlock: no command for 0.3")
    assert lock.reset()[0]
    assert lock.act(10_301 * MS) == 0.0 and lock.condition() == (WARN, "not enabled")
    lock.enable(True)
    lock.act(10_302 * MS)
    assert lock.stage == LOW


QUIET = {name: {"action": "none"} for name in ("sensor_jump", "sensor_implausible", "velocity", "valve_implausible")}


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_table_that_is_reset_beyond_the_hard_limit_moves_towards_the_middle_alone(side) -> None:
    lock = running(**QUIET, command_jump={"action": "none"})

    def steps(position: float, u: float, first: int) -> list[float]:
        acted = []
        for k in range(first, first + 5000):
            lock.observe(k * MS, side * (position + 1e-6 * (k % 2)), 0.01 * (k % 2), SUPPLY)
            lock.command(k * MS, side * u)
            acted.append(lock.act(k * MS))
        return acted

    steps(0.127, 0.2, 10_000)
    assert lock.tripped and lock.reset()[0]
    lock.enable(True)
    assert set(steps(0.127, 0.2, 15_000)) == {0.0} and lock.stage == RUN
    assert steps(0.127, -0.2, 20_000)[-1] == -0.2 * side
    assert steps(0.05, 0.2, 25_000)[-1] == 0.2 * side
    steps(0.127, 0.2, 30_000)
    assert lock.tripped  # the limit is armed again


def moved(lock: Interlock, speed: float, u: float) -> int | None:
    """Milliseconds after which the lock trips, of 500, where the table moves at `speed` and `u` is commanded."""
    for k in range(500):
        now = (10_000 + k) * MS
        lock.observe(now, 1e-3 * speed * k + 1e-5 * (k % 2), 0.01 * (k % 2), SUPPLY)
        lock.command(now, u)
        lock.act(now)
        if lock.tripped:
            return k
    return None


def test_table_that_moves_as_its_valve_is_open_trips_nothing() -> None:
    lock = running()
    assert moved(lock, 0.2 * lock.parameters.full_speed, 0.2) is None


@pytest.mark.parametrize(("speed", "u"), [(0.0, 0.25), (0.2, 0.0), (-0.1, 0.2)])
def test_valve_that_does_not_follow_its_command_takes_the_pressure_off_within_50_ms(speed, u) -> None:
    lock = running(sensor_implausible={"action": "none"})
    after = moved(lock, speed, u)
    assert after is not None and after < 50
    assert lock.leading is not None and lock.leading.cause == "valve_implausible"


def test_command_that_jumps_holds_the_program_and_one_that_is_as_quick_as_an_earthquake_does_not() -> None:
    lock = running()
    lock.command(10_000 * MS, 0.05)
    lock.act(10_000 * MS)
    assert not lock.hold_severity
    lock.command(10_001 * MS, -0.5)
    lock.act(10_001 * MS)
    assert lock.leading is not None and lock.leading.cause == "command_jump" and lock.stage == RUN


@pytest.mark.parametrize("action", ACTIONS)
def test_each_action_does_what_its_name_says(action) -> None:
    lock = running(clock_jump={"action": action, "latch": True}, command_jump={"action": "none"})
    lock.command(10_000 * MS, 0.5)
    assert lock.act(10_000 * MS) == 0.5
    lock.compare(10_000 * MS, "clock_jump", 3.0)
    acted = []
    for k in range(10_000, 14_000):
        lock.command(k * MS, 0.5)
        acted.append(lock.act(k * MS))
    assert (acted[-1] == 0.5) == (action in ("none", "indicate"))
    assert bool(lock.trips) == (action != "none")
    expected = {"program_hold": RUN, "program_stop": OFF, "hydraulic_interlock": OFF}
    assert lock.stage == expected.get(action, RUN)
    at_once = action == "hydraulic_interlock"
    assert (acted[0] == 0.0) == at_once


def test_changes_that_would_take_the_protection_away_are_refused_with_a_reason() -> None:
    with pytest.raises(ShakeError, match="`stop` must at least hold"):
        parameters(causes={"stop": {"action": "indicate"}})
    with pytest.raises(ShakeError, match=r"position_soft.threshold = 0.2 m is beyond causes.position_hard"):
        parameters("bergamo", causes={"position_soft": {"threshold": 0.2}})
    with pytest.raises(ShakeError, match="unknown action 'explode'"):
        parameters(causes={"velocity": {"action": "explode"}})


def test_configuration_names_every_cause() -> None:
    content = read_yaml(find("interlock", "bergamo"))
    del content["causes"]["velocity"]
    with pytest.raises(ShakeError, match="here: missing cause velocity"):
        InterlockParameters.from_mapping(content, "here")
    content["causes"]["temper"] = {}
    with pytest.raises(ShakeError, match="unknown cause 'temper'"):
        InterlockParameters.from_mapping(content, "here")


def test_same_inputs_give_the_same_answers() -> None:
    def run() -> list[float]:
        lock, acted = Interlock(parameters("target"), enabled=True), []
        generator = np.random.default_rng(5)
        for k, (x, u) in enumerate(generator.normal(0.0, 0.02, (4000, 2))):
            lock.observe(k * MS, x * 1e-3, u, SUPPLY)
            if k % 97 < 60:
                lock.command(k * MS, u)
            acted.append(lock.act(k * MS))
        return acted

    first = run()
    assert any(first) and first == run()


def test_jump_of_a_delayed_command_is_said_for_when_it_came() -> None:
    lock = running()
    for k in range(10_000, 10_010):
        lock.act(k * MS)
    lock.command(10_001 * MS, 0.9)
    assert [(trip.cause, trip.time) for trip in lock.trips] == [("command_jump", 10_009 * MS)]
