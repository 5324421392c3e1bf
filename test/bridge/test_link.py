"""Host and target over real sockets: session, watchdog, faults, a bad link, strangers."""

from __future__ import annotations

import math
import socket

import pytest

from shake_ros.bridge import wire
from shake_ros.bridge.emulator import parse_fault
from shake_ros.quantities import ShakeError
from shake_ros.safety.causes import HIGH, LOW, NUMBERS, OFF, RUN

STALE, LOST = 20, 200  # [ms] of config/interlock/target.yaml


def stage(measurement: wire.TableDatagram) -> int:
    return measurement.status & wire.STAGE_MASK


def test_session_begins_and_the_table_moves_at_the_stage_run(make_pair) -> None:
    pair = make_pair()
    pair.start()
    before = pair.newest.position
    moved = pair.run(200, 0.05)
    assert moved[-1].position - before > 1e-3
    assert moved[-1].answered == pair.host.session.sent - 1
    assert moved[-1].acting == 0.05
    assert (pair.host.lost, pair.link.sessions, pair.host.sessions) == (0, 1, 1)


def test_target_goes_no_further_than_the_stage_that_is_asked_for(make_pair) -> None:
    pair = make_pair()
    assert {stage(one) for one in pair.run(1500, 0.3, mode=LOW)} == {OFF, LOW}
    assert {stage(one) for one in pair.run(1500, 0.3, mode=HIGH)} == {LOW, HIGH}
    assert pair.newest.acting == 0.0
    pair.run(600, 0.0)
    assert stage(pair.newest) == RUN
    pair.run(1500, 0.0, mode=OFF)
    assert stage(pair.newest) == OFF


def test_lower_stage_is_reached_by_a_ramp_unless_the_host_has_tripped(make_pair) -> None:
    pair = make_pair()
    pair.start()
    pair.run(100, 0.2)
    ramp = pair.run(200, 0.2, mode=OFF)
    assert ramp[3].acting > 0.1 and stage(ramp[3]) == RUN and stage(ramp[-1]) == LOW
    pair.start()
    pair.run(1100, 0.0)
    pair.run(100, 0.2)
    cut = pair.run(200, 0.2, mode=OFF, flags=wire.AT_ONCE)
    assert cut[0].acting == 0.2  # answers the sample before
    assert {(one.acting, stage(one)) for one in cut[2:]} == {(0.0, OFF)}
    assert not cut[-1].status & wire.TRIPPED
    pair.start()


def test_watchdog_ramps_the_valve_to_null_and_then_takes_the_pressure_off(make_pair) -> None:
    pair = make_pair()
    pair.start()
    pair.run(100, 0.2)
    silent = pair.run(400, None)
    acting = [one.acting for one in silent]
    assert all(u == 0.2 for u in acting[: STALE - 2])
    assert acting[STALE + 5] < 0.2 and acting[STALE + 60] == 0.0
    stages = [stage(one) for one in silent]
    assert stages[LOST - 5] == RUN and stages[LOST + 5] == OFF
    assert silent[-1].trip == NUMBERS["command_lost"] and silent[-1].status & wire.TRIPPED
    assert silent[-1].pressure_supply < 50e5
    travel = max(one.position for one in silent) - silent[STALE].position
    assert travel < 5e-3, f"{travel} m after the watchdog"
    resumed = pair.run(100, 0.2)
    assert stage(resumed[-1]) == OFF  # until reset
    pair.run(2, 0.0, mode=OFF, flags=wire.RESET)
    pair.start()


def test_command_that_is_no_number_does_not_move_the_valve(make_pair) -> None:
    pair = make_pair()
    pair.start()
    pair.run(50, 0.1)
    held = pair.run(100, math.nan)
    assert held[-1].acting == 0.0 and stage(held[-1]) == RUN
    assert pair.run(10, 0.1)[-1].acting == 0.1


def test_stranger_without_the_key_gets_no_session(make_pair) -> None:
    pair = make_pair(key=b"some other key, also 32 by long.")
    pair.run(50, 0.1)
    assert pair.link.session is None and pair.host.session is None
    assert pair.link.rejected["tag"] >= 1


def test_second_host_is_refused_while_the_first_commands(make_pair) -> None:
    pair = make_pair()
    pair.start()
    second = pair.new_host(pair.link.address[1])
    try:
        for _ in range(20):
            pair.step(0.0)
            assert second.receive(0.0) is None
        assert pair.link.rejected["session"] >= 1 and pair.link.sessions == 1
    finally:
        second.close()


def test_forged_replayed_truncated_and_oversized_datagrams_are_rejected_and_counted(make_pair) -> None:
    pair = make_pair()
    pair.start()
    pair.run(100, 0.0)
    session = pair.host.session
    old = wire.command(session.key, wire.Command(session.number, 5, 5, 1.0, RUN, 0))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker:
        forged = bytearray(wire.command(session.key, wire.Command(session.number, 10**6, 5, 1.0, RUN, 0)))
        forged[32] ^= 1
        for data in (old, bytes(forged), old[:30], old * 20, b""):
            attacker.sendto(data, pair.link.address)
    pair.run(5, 0.0)
    rejected = {reason: count for reason, count in pair.link.rejected.items() if count}
    assert rejected == {"replay": 1, "tag": 1, "size": 3}
    assert pair.newest.acting == 0.0


def test_recorded_hello_of_an_earlier_session_ends_nothing(make_pair) -> None:
    pair = make_pair()
    pair.start()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker:
        attacker.sendto(wire.hello(pair.key, bytes(16)), pair.link.address)
    assert len(pair.run(50, 0.1)) == 50
    assert pair.link.sessions == 1


FAULTS = {
    "position_off@1.5": "sensor_missing",
    "position_frozen@1.5": "sensor_frozen",
    "acceleration_off@1.5": "sensor_missing",
    "position_bias@1.5=0.01": "sensor_jump",
    "acceleration_bias@1.5=20": "sensor_implausible",
    "supply_failure@1.5": "supply_pressure_low",
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_of_a_sensor_or_of_the_supply_trips_the_target_itself(make_pair, fault) -> None:
    pair = make_pair(fault)
    pair.start()
    for k in range(2000):
        measured = pair.step(0.05 * math.sin(0.0126 * k))
        if measured is not None and measured.status & wire.TRIPPED:
            break
    assert measured is not None and measured.trip == NUMBERS[FAULTS[fault]]
    after = pair.step(0.05)
    assert after.acting == 0.0 and stage(after) == OFF


def test_stuck_valve_moves_as_it_was_and_no_command_changes_it(make_pair) -> None:
    pair = make_pair()
    pair.start()
    pair.run(50, 0.05)
    pair.switches.switch("valve_stuck")
    assert {one.acting for one in pair.run(50, -0.05)[1:]} == {0.05}
    pair.switches.switch("valve_stuck off")
    assert pair.run(5, -0.05)[-1].acting == -0.05


def test_target_takes_the_pressure_off_where_the_valve_does_not_follow(make_pair) -> None:
    pair = make_pair()
    pair.start()
    pair.run(50, 0.1)
    pair.switches.switch("valve_stuck")
    assert pair.run(50, -0.2)[-1].trip == NUMBERS["valve_implausible"]
    assert stage(pair.run(2, -0.2)[-1]) == OFF


def test_output_card_takes_the_valve_to_null_where_the_target_stands_still(make_pair) -> None:
    pair = make_pair()
    pair.start()
    pair.run(100, 0.3)
    machine = pair.emulator.machine
    before, speed = machine.measure().truth_position, machine.measure().truth_velocity
    pair.time += 499
    pair.step(None)
    travel = machine.measure().truth_position - before
    assert 0.0 < travel < 0.01 * speed + 1e-3  # 5 ms at speed and the closing of the valve, not half a second
    pair.step(None)
    assert pair.emulator.interlock.tripped


@pytest.mark.parametrize("text", ["melted", "position_bias", "silent=1", "deaf@x", "position_bias=nan", ""])
def test_fault_that_is_none_is_refused(text) -> None:
    with pytest.raises(ShakeError, match="fault"):
        parse_fault(text)


def test_link_that_loses_delays_doubles_and_breaks_keeps_the_table_in_order(make_pair, make_relay) -> None:
    pair = make_pair()
    relay = make_relay(pair.link.address)
    pair.host.close()
    pair.host = pair.new_host(relay.port)
    for k in range(5000):
        relay.carry()
        pair.step(0.05 * math.sin(0.0126 * k) if k > 2000 else 0.0)
        relay.carry()
    assert stage(pair.newest) == RUN
    assert pair.host.sessions == pair.link.sessions == 1
    assert 0.01 < pair.host.lost / pair.host.received < 0.08
    for end in (pair.host, pair.link):
        assert end.rejected["replay"] > 20
        assert sum(end.rejected[reason] for reason in ("tag", "magic", "version", "kind", "size", "session")) > 20
    assert not [trip for trip in pair.emulator.interlock.trips if trip.cause == "command_lost"]
