"""Topics as robots publish them: other joints, other publishers, absent accelerations, other clocks."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shake_ros as sr
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import BagWriter, TableRecording, read_table_recording
from shake_ros.recordings.bags.cdr import typestore

JOINT, IMU = "sensor_msgs/msg/JointState", "sensor_msgs/msg/Imu"
COUNT, PERIOD, START = 1500, 2_000_000, 1_700_000_000 * 10**9
TIME = np.arange(COUNT) * PERIOD / 1e9
TURN = 2.0 * np.pi * (1.0 * TIME + 0.5 * TIME**2)  # a sweep: no offset of a clock looks like another
COMMAND, POSITION = 0.3 * np.sin(TURN), 0.02 * np.sin(TURN - 0.5)
SPEED = 2.0 * np.pi * (1.0 + TIME)
FELT = 0.02 * (2.0 * np.pi * np.cos(TURN - 0.5) - SPEED**2 * np.sin(TURN - 0.5))
Messages = Iterator[tuple[str, str, int, Any]]  # topic, type, time of receipt [ns], message


def header(stamp: int, frame: str = "") -> Any:
    kinds = typestore().types
    time = kinds["builtin_interfaces/msg/Time"](int(stamp // 10**9), int(stamp % 10**9))
    return kinds["std_msgs/msg/Header"](time, frame)


def joint(stamp: int, values: dict[str, float], frame: str = "", numbers: bool = True) -> Any:
    positions = np.array(list(values.values()) if numbers else [], dtype=float)
    speeds = np.zeros(0 if numbers else len(values))
    return typestore().types[JOINT](header(stamp, frame), list(values), positions, speeds, np.zeros(0))


def imu(stamp: int, acceleration: float, covariance: float = 0.0, frame: str = "table") -> Any:
    kinds = typestore().types
    vector, turn = kinds["geometry_msgs/msg/Vector3"], kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    none, own = np.zeros(9), np.array([covariance, *(0.0,) * 8])
    felt = vector(float(acceleration), 0.0, 9.81)
    return kinds[IMU](header(stamp, frame), turn, none, vector(0.0, 0.0, 0.0), none, felt, own)


def at(k: int) -> int:
    return START + k * PERIOD


def table(k: int) -> Messages:
    yield "/joint_states", JOINT, at(k) + 2000, joint(at(k), {"table": POSITION[k]})


def felt(k: int) -> Messages:
    yield "/imu", IMU, at(k) + 3000, imu(at(k), FELT[k])


def command(k: int) -> Messages:
    yield "/valve_command", JOINT, at(k) + 4000, joint(at(k), {"servo_valve": COMMAND[k]})


Writes = Callable[..., Path]


@pytest.fixture
def bag(tmp_path: Path) -> Writes:
    """Write a recording of what some functions of the sample's number yield, in the order of receipt."""

    def write(*sources: Callable[[int], Messages], count: int = COUNT) -> Path:
        path = tmp_path / f"bag_{len(list(tmp_path.iterdir()))}"
        rows = sorted((row for k in range(count) for of in sources for row in of(k)), key=lambda row: row[2])
        with BagWriter(path) as writer:
            numbers = {topic: writer.add_topic(topic, kind) for topic, kind in {row[0]: row[1] for row in rows}.items()}
            for topic, kind, received, message in rows:
                writer.write(numbers[topic], received, bytes(typestore().serialize_cdr(message, kind)))
        return path

    return write


def lines(recording: TableRecording) -> str:
    return " | ".join(f"{f.kind}: {f}" for f in recording.findings)


def stranger(values: dict[str, float], shift: int = 0, every: int = 1, **how: Any) -> Callable[[int], Messages]:
    def of(k: int) -> Messages:
        if k % every == every // 2:
            stamp = at(k) + shift
            yield "/joint_states", JOINT, at(k) + max(shift, 0) % PERIOD + 1000, joint(stamp, values, **how)

    return of


OTHERS = {
    "another joint between the stamps": stranger({"crane": 0.7}, PERIOD // 2, 50),
    "another joint at the same stamps": stranger({"crane": 0.7}),
    "an arm before and behind": stranger({"arm_1": 0.7, "arm_2": -0.7}, -PERIOD // 3),
    "a joint without a name": stranger({"": 0.7}, PERIOD // 2, 3),
    "the table's speed alone": stranger({"table": 0.0}, PERIOD // 2, 3, numbers=False),
}


@pytest.mark.parametrize("what", OTHERS)
def test_position_is_read_by_the_tables_joint_alone(bag: Writes, what: str) -> None:
    found = read_table_recording(bag(table, OTHERS[what], felt, command))
    np.testing.assert_array_equal(found.position, POSITION)
    np.testing.assert_array_equal(found.valve_command, COMMAND)
    assert found.segments == (slice(0, COUNT),)
    assert "left out" in lines(found)


def test_table_stands_anywhere_in_a_message_and_the_others_are_reported(bag: Writes) -> None:
    def mixed(k: int) -> Messages:
        values = {"crane": 0.7, "table": POSITION[k]} if k % 2 else {"table": POSITION[k], "crane": 0.7}
        yield "/joint_states", JOINT, at(k) + 2000, joint(at(k), values)

    found = read_table_recording(bag(mixed, command))
    np.testing.assert_array_equal(found.position, POSITION)
    assert lines(found) == "joint: /joint_states: other joints are left out: crane (0 messages have only these)"


def test_single_joint_of_another_name_is_read_and_said_and_several_are_refused(bag: Writes) -> None:
    def of(*names: str) -> Callable[[int], Messages]:
        return lambda k: iter(
            [("/joint_states", JOINT, at(k) + 2000, joint(at(k), dict.fromkeys(names, 0.1) | {names[0]: POSITION[k]}))]
        )

    found = read_table_recording(bag(of("slider"), command))
    np.testing.assert_array_equal(found.position, POSITION)
    assert "joint: /joint_states: has no joint 'table'; its only joint, 'slider', is read" in lines(found)
    path = bag(of("x_axis", "y_axis"), command)
    with pytest.raises(ShakeError, match="has no joint 'table', but x_axis, y_axis; choose one, as in --take joint_s"):
        read_table_recording(path)
    np.testing.assert_array_equal(sr.read(path, take={"joint_states": "x_axis"})[0].position, POSITION)
    with pytest.raises(ShakeError, match="has no joint 'z_axis'"):
        sr.read(path, take={"joint_states": "z_axis"})


SECOND_PUBLISHERS = {
    "zeros now and then": stranger({"table": 0.0}, PERIOD // 2, 50),
    "zeros at a third of the rate": stranger({"table": 0.0}, PERIOD // 2, 3),
    "as often, in between": stranger({"table": 0.3}, PERIOD // 2),
    "shortly behind each": stranger({"table": -0.05}, PERIOD // 5),
    "at the same stamps": stranger({"table": 0.3}, 0, 10),
    "on another clock": stranger({"table": 0.3}, round(-1e18), 3),
    "in another frame": stranger({"table": 0.3}, PERIOD // 2, 5, frame="gui"),
    "beside another joint": stranger({"table": 0.0, "crane": 0.7}, PERIOD // 2, 2),
}


@pytest.mark.parametrize("what", SECOND_PUBLISHERS)
def test_two_publishers_of_the_joint_are_refused_unless_one_is_chosen(bag: Writes, what: str) -> None:
    path = bag(table, SECOND_PUBLISHERS[what], command)
    with pytest.raises(ShakeError, match=r"has 2 publishers of joint 'table': 1: .* choose one, as in --take joint_s"):
        read_table_recording(path)
    found = [sr.read(path, take={"joint_states": number})[0] for number in (1, 2)]
    own = found[0] if len(found[0]) >= COUNT - 20 and np.ptp(found[0].position) > 0.01 else found[1]
    assert len(own) == COUNT
    np.testing.assert_array_equal(own.position, POSITION)
    with pytest.raises(ShakeError, match="has 2 publishers, not 3"):
        sr.read(path, take={"joint_states": 3})


def test_one_publisher_with_jitter_dropouts_and_changing_frames_is_one(bag: Writes) -> None:
    rng = np.random.default_rng(1)
    late = rng.normal(0.0, 0.2 * PERIOD, COUNT).astype(int)

    def rough(k: int) -> Messages:
        value = 0.0 if k % 97 == 5 else POSITION[k]
        yield "/joint_states", JOINT, at(k) + 2000, joint(at(k) + int(late[k]), {"table": value}, "f" * (k % 4))

    assert len(read_table_recording(bag(rough, command)).position) > 0.98 * COUNT

    def at_rest(k: int) -> Messages:
        steps = 0.01 + 1e-5 * rng.integers(-1, 2)
        yield "/joint_states", JOINT, at(k) + 2000, joint(at(k), {"table": steps})

    assert len(read_table_recording(bag(at_rest, command))) == COUNT


def test_commands_that_alternate_are_of_one_publisher(bag: Writes) -> None:
    def chattering(k: int) -> Messages:
        yield "/valve_command", JOINT, at(k) + 4000, joint(at(k), {"servo_valve": 0.5 * (-1.0) ** k})

    np.testing.assert_array_equal(
        read_table_recording(bag(table, chattering)).valve_command[:4], [0.5, -0.5, 0.5, -0.5]
    )


def test_absent_accelerations_are_left_out_and_data_beside_minus_one_kept(bag: Writes) -> None:
    def given(value: Callable[[int], float], covariance: Callable[[int], float]) -> TableRecording:
        def of(k: int) -> Messages:
            yield "/imu", IMU, at(k) + 3000, imu(at(k), value(k), covariance(k))

        return read_table_recording(bag(table, of, command))

    half = given(lambda k: 0.0 if k % 2 else FELT[k], lambda k: -1.0 if k % 2 else 0.0)
    assert half.acceleration is not None
    np.testing.assert_array_equal(half.acceleration[::2], FELT[::2])
    assert np.nanmax(np.abs(half.acceleration - FELT)) < 0.05 * np.max(np.abs(FELT))
    assert "750 of 1500 messages contain no acceleration (covariance −1); they are left out" in lines(half)
    none = given(lambda k: 0.0, lambda k: -1.0)
    assert none.acceleration is None
    assert none.segments == (slice(0, COUNT),)
    kept = given(lambda k: FELT[k], lambda k: -1.0)
    np.testing.assert_array_equal(kept.acceleration, FELT)
    assert "covariance: /imu: 1500 messages declare their acceleration as not measured" in lines(kept)


def test_imu_has_the_names_of_rep_145(bag: Writes) -> None:
    def named(topic: str, factor: float = 1.0) -> Callable[[int], Messages]:
        return lambda k: iter([(topic, IMU, at(k) + 3000, imu(at(k), factor * FELT[k]))])

    for topics, taken in ((("/imu/data",), "/imu/data"), (("/t/imu/data", "/t/imu/data_raw"), "/t/imu/data_raw")):
        found = read_table_recording(bag(table, command, *map(named, topics)))
        assert found.provenance.topics["imu"] == taken
        np.testing.assert_array_equal(found.acceleration, FELT)
    path = bag(table, command, named("/imu"), named("/crane/imu/data", 2.0))
    with pytest.raises(ShakeError, match="two topics end in 'imu': /crane/imu/data and /imu"):
        read_table_recording(path)
    np.testing.assert_array_equal(sr.read(path, take={"imu": "/crane/imu/data"})[0].acceleration, 2.0 * FELT)


def on_clock(of: Callable[[int], Messages], offset: float, drift: float = 0.0) -> Callable[[int], Messages]:
    """The same with stamps of another clock, received when they were."""

    def moved(k: int) -> Messages:
        for topic, kind, received, message in of(k):
            stamp = at(k) + round(offset * 1e9) + round(drift * k * PERIOD)
            message.header = header(stamp, message.header.frame_id)
            yield topic, kind, received, message

    return moved


BOOT = 1.0 - START / 1e9


@pytest.mark.parametrize(
    ("sources", "said"),
    [
        (
            (table, felt, on_clock(command, BOOT)),
            "/valve_command: stamps are of another clock: they are 1.7e+09 s behind",
        ),
        ((table, on_clock(felt, BOOT), command), "/imu: stamps are of another clock: they are 1.7e+09 s behind"),
        ((on_clock(table, BOOT), felt, command), "/imu: stamps are of another clock: they are 1.7e+09 s ahead of"),
        ((table, on_clock(felt, 0.2), command), "/imu: stamps are of another clock: they are 0.2 s ahead of"),
        ((table, on_clock(felt, -0.2), command), "/imu: stamps are of another clock: they are 0.2 s behind"),
        ((table, on_clock(felt, -0.02), command), "/imu: stamps are of another clock: they are 0.02 s behind"),
        ((table, felt, on_clock(command, -0.2)), "/valve_command: stamps are of another clock: they are 0.2 s behind"),
        (
            (table, felt, on_clock(command, 0.05)),
            "/valve_command: stamps are of another clock: they are 0.05 s ahead of",
        ),
        ((table, on_clock(felt, 3600.0), command), "/imu: stamps are of another clock: they are 3600 s ahead of"),
    ],
)
def test_stamps_of_another_clock_are_named_and_aligned(
    bag: Writes, sources: tuple[Callable[[int], Messages], ...], said: str
) -> None:
    found = read_table_recording(bag(*sources))
    assert said in lines(found)
    assert lines(found).count("by the times of receipt; removed") == sum("clock" == f.kind for f in found.findings)
    np.testing.assert_array_equal(found.position, POSITION)
    np.testing.assert_array_equal(found.valve_command, COMMAND)
    np.testing.assert_array_equal(found.acceleration, FELT)


@pytest.mark.parametrize("offset", [0.0, 0.5, BOOT])
def test_drift_of_a_clock_is_estimated_and_taken_off(bag: Writes, offset: float) -> None:
    found = read_table_recording(bag(table, on_clock(felt, offset, 1e-3), command))
    assert "and drift by +999 ppm" in lines(found) or "and drift by +1000 ppm" in lines(found)
    assert found.acceleration is not None
    assert np.nanmax(np.abs(found.acceleration - FELT)) < 1e-3 * np.max(np.abs(FELT))


def test_messages_late_on_the_way_are_taken_as_they_are_stamped(bag: Writes) -> None:
    late = np.random.default_rng(2).gamma(2.0, 8e6, COUNT).astype(int)

    def slow(k: int) -> Messages:
        yield "/imu", IMU, at(k) + 60_000_000 + int(late[k]), imu(at(k), FELT[k])

    found = read_table_recording(bag(table, slow, command))
    np.testing.assert_array_equal(found.acceleration, FELT)
    assert "taken off" not in lines(found)


def test_recording_in_simulated_time_has_one_clock(bag: Writes) -> None:
    """All stamps from 1 s on, at a speed that varies."""
    received = np.cumsum(np.random.default_rng(3).uniform(0.2, 3.0, COUNT) * PERIOD).astype(int)

    def simulated(of: Callable[[int], Messages]) -> Callable[[int], Messages]:
        def moved(k: int) -> Messages:
            for topic, kind, when, message in on_clock(of, BOOT)(k):
                yield topic, kind, START + int(received[k]) + when - at(k), message

        return moved

    found = read_table_recording(bag(*map(simulated, (table, felt, command))))
    assert found.findings == ()
    np.testing.assert_array_equal(found.acceleration, FELT)


def test_times_of_receipt_that_are_all_the_same_say_nothing_of_clocks(bag: Writes) -> None:
    def at_once(of: Callable[[int], Messages]) -> Callable[[int], Messages]:
        return lambda k: ((topic, kind, START, message) for topic, kind, _, message in of(k))

    found = read_table_recording(bag(*map(at_once, (table, felt, command))))
    assert found.findings == ()
    np.testing.assert_array_equal(found.acceleration, FELT)
    other = read_table_recording(bag(*map(at_once, (table, on_clock(felt, BOOT), command))))
    assert other.acceleration is None
    assert "/imu: stamps are 1.7e+09 s behind the positions' received with them" in lines(other)


def test_latencies_of_other_topics_leave_the_offset_to_a_millisecond(bag: Writes) -> None:
    def late(of: Callable[[int], Messages], seconds: float, seed: int) -> Callable[[int], Messages]:
        more = np.random.default_rng(seed).gamma(2.0, 0.5e9 * seconds, COUNT).astype(int)
        return lambda k: ((topic, kind, when + int(more[k]), m) for topic, kind, when, m in of(k))

    found = read_table_recording(bag(late(table, 1e-3, 1), late(on_clock(felt, BOOT), 1e-3, 2), late(command, 1e-3, 3)))
    assert found.acceleration is not None
    np.testing.assert_allclose(found.acceleration[5:-5], FELT[5:-5], atol=0.02 * np.max(np.abs(FELT)))
    assert "/imu: stamps are of another clock: they are 1.7e+09 s behind" in lines(found)


def test_two_sensors_on_one_topic_are_refused_unless_one_is_chosen(bag: Writes) -> None:
    def specimen(k: int, frame: str, shift: int = 0) -> Messages:
        yield "/imu", IMU, at(k) + 3500, imu(at(k) + shift, 3.0 + 2.0 * FELT[k], frame=frame)

    for other in (lambda k: specimen(k, "specimen", PERIOD // 3), lambda k: specimen(k, "table")):
        path = bag(table, felt, other, command)
        with pytest.raises(ShakeError, match=r"topic '/imu' has 2 publishers: 1: .* choose one, as in --take imu=1"):
            read_table_recording(path)
        np.testing.assert_array_equal(sr.read(path, take={"imu": 1})[0].acceleration, FELT)


@pytest.mark.parametrize(
    ("take", "said"),
    [
        ({"joints": "table"}, "joints"),
        ({"imu": "table"}, "imu has no joints"),
        ({"imu": "/none"}, "no topic '/none'; the recording holds /imu"),
    ],
)
def test_choice_that_is_none_is_refused(bag: Writes, take: dict[str, str], said: str) -> None:
    with pytest.raises(ShakeError, match=said):
        sr.read(bag(table, felt, command, count=20), take=take)


@pytest.mark.parametrize("folder", ["10-shared-joint-states", "11-imu-not-present", "12-clocks"])
def test_files_of_others_are_read_right_or_refused_in_one_line(
    shared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], folder: str
) -> None:
    """Their script writes the recordings; a sine of 2 Hz, whose values are known."""
    monkeypatch.chdir(tmp_path)
    spec = importlib.util.spec_from_file_location("bags", shared / "data" / "files_of_others" / folder / "bags.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules.pop("bags", None)
    spec.loader.exec_module(module)
    capsys.readouterr()
    refused = {"zeros_of_a_second_publisher": "2 publishers of joint 'table'", "no_joint_named_table": "x_axis, y_axis"}
    without = {"crane_own_stamps", "no_acceleration_at_all"}
    for path in sorted((tmp_path / "out").iterdir()):
        name = path.name.removeprefix("bag_")
        if name in refused:
            with pytest.raises(ShakeError, match=refused[name]):
                read_table_recording(path)
            continue
        found = read_table_recording(path)
        np.testing.assert_array_equal(found.position, module.x)
        np.testing.assert_array_equal(found.valve_command, module.u)
        assert (found.acceleration is None) == (name in without), name
        if found.acceleration is not None:
            off = np.nanmax(np.abs(found.acceleration - module.a))
            assert off < (0.01 if name.startswith("every_second") else 1e-12), name
        assert (found.findings == ()) == (name in ("right", "rep145_name")), name
