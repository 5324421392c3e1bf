"""`lab`: one command starts all, a second one is refused, Ctrl-C ends in order; what its arguments become."""

from __future__ import annotations

import json
import subprocess
import tempfile
from pathlib import Path

import pytest
from lab_process import LAB, QUICK, ROOT, Started
from machine_time import on_a_machine_that_keeps_time

from benchmarks.realtime.emulated_target import emulated_target
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import read_table_recording
from shake_ros.ros import lab
from shake_ros.settings import config_folder

SEQUENCE = 20.0  # low and high pressure, full span, some seconds of a busy machine [s]


def test_one_command_runs_the_table_refuses_a_second_and_ends_in_order(ros_domain, tmp_path) -> None:
    arguments = ["--headless", "--lockstep", "--enabled", "--play", "--record", "run", "--folder", str(tmp_path)]
    started = Started(*arguments, *QUICK)
    started.wait_for("running: recorder, plant")
    second = subprocess.run(
        [*LAB, "--headless", "--folder", str(tmp_path)], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert second.returncode == 2
    assert "topic /shake/joint_states is published already" in second.stderr
    assert started.end() == 0, started.lines
    assert [line for line in started.lines if "the table is slow here" not in line][-3:] == [
        "lab: stopping: hold, pressure off",
        f"lab: recording closed: {tmp_path}/recordings/run",
        "lab: ended",
    ]
    recording = read_table_recording(tmp_path / "recordings" / "run")
    assert recording.provenance.complete
    assert recording.pressure_supply is not None
    assert recording.pressure_supply.max() > 150e5
    assert recording.pressure_supply[-1] < 50e5


def test_node_that_dies_is_named_with_its_reason_and_the_rest_ends(ros_domain, tmp_path) -> None:
    started = Started("--headless", "--lockstep", "--set", "controller.limit=7.0", "--folder", str(tmp_path))
    line = started.wait_for("controller died")
    assert "limit = 7 is outside 0 … 1" in line or "limit = 7.0 is outside 0 … 1" in line
    assert started.end() == 1
    assert started.lines[-1] == "lab: stopped, with losses"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--set", "plant"], "expected NODE.PARAMETER=VALUE"),
        (["--set", "plan.seed=1"], "no such node here; there are plant"),
        (["--bridge", "emulator", "--lockstep"], "a real table runs in real time"),
        (["--pace", "2"], "--pace: only with --lockstep"),
        (["--address", "0.0.0.0"], "only with --certificate and --key"),
    ],
)
def test_arguments_that_cannot_work_are_refused_before_anything_starts(tmp_path, arguments, text) -> None:
    with pytest.raises(ShakeError, match=text):
        lab.main([*arguments, "--folder", str(tmp_path)])


@pytest.mark.parametrize(
    ("arguments", "pace"), [([], 1.0), (["--headless"], 0.0), (["--headless", "--pace", "3"], 3.0)]
)
def test_lockstep_keeps_the_pace_of_who_watches(tmp_path, arguments, pace) -> None:
    given = lab.parser().parse_args(["--lockstep", *arguments])
    assert lab.table_node(given).parameters["pace"] == pace


@pytest.mark.parametrize(
    ("arguments", "processors", "told"),
    [
        (["--realtime"], 2, True),
        (["--realtime"], 4, False),
        (["--realtime", "--composed"], 2, False),
        (["--realtime", "--headless"], 2, False),
        ([], 2, False),
    ],
)
def test_nodes_with_priority_that_leave_the_page_no_processor_are_told(arguments, processors, told) -> None:
    assert ("--composed runs" in lab.crowded(lab.parser().parse_args(arguments), processors)) is told


@pytest.mark.parametrize(("more", "apart", "readers"), [([], ["thd_analyzer"], 2), (["--lockstep"], [], 3)])
def test_composed_loop_is_one_process_and_holds_the_analyzer_in_lock_step_alone(tmp_path, more, apart, readers) -> None:
    given = lab.parser().parse_args(["--composed", "--record", "a", "--folder", str(tmp_path), *more])
    started = lab.nodes(given, tmp_path / "lab")
    assert [one.called for one in started] == ["page", "recorder", *apart, "loop"]
    assert f"joint_states:{readers}" in started[-1].program[-1]
    assert ("thd_analyzer" in started[-1].program[-1]) is (not apart)


def test_priority_is_for_the_loop_alone(tmp_path) -> None:
    given = lab.parser().parse_args(["--realtime", "--record", "a", "--folder", str(tmp_path)])
    asking = [one.called for one in lab.nodes(given, tmp_path / "lab") if one.parameters.get("realtime.enabled")]
    assert asking == ["plant", "reference_generator", "observer", "controller"]


def test_composed_lab_runs_records_and_ends_by_itself_when_its_time_is_over(ros_domain, tmp_path) -> None:
    arguments = ["--composed", "--headless", "--lockstep", "--enabled", "--record", "run", "--duration", "0.5"]
    started = Started(*arguments, "--folder", str(tmp_path))
    assert started.process.wait(120) == 0, started.lines
    assert started.lines[-2:] == [f"lab: recording closed: {tmp_path}/recordings/run", "lab: ended"]
    assert len(read_table_recording(tmp_path / "recordings" / "run")) == 500


def test_composed_lab_that_still_compiles_ends_when_told(ros_domain, tmp_path) -> None:
    arguments = ["--composed", "--headless", "--lockstep", "--folder", str(tmp_path)]
    started = Started(*arguments, NUMBA_CACHE_DIR=str(tmp_path / "empty"))
    started.wait_for("compiling, as at every first start")
    assert started.end() == 0, started.lines
    assert started.lines[-1] == "lab: ended"


@pytest.mark.second_tier
@on_a_machine_that_keeps_time
def test_lab_over_a_bridge_takes_the_target_through_its_stages_and_stops_it_in_order(ros_domain, tmp_path) -> None:
    folder = Path(tempfile.mkdtemp(dir=tmp_path))
    with emulated_target(folder) as (target, bridge):
        arguments = ["--headless", "--bridge", bridge, "--enabled", "--record", "run", "--folder", str(folder)]
        with Started(*arguments) as started:
            started.wait_for("running: recorder, hardware_bridge")
            started.wait_for("commands act", SEQUENCE)
            assert started.end() == 0, started.lines
        assert [line for line in started.lines if "the table is slow here" not in line][-3:] == [
            "lab: stopping: hold, pressure off",
            f"lab: recording closed: {folder}/recordings/run",
            "lab: ended",
        ]
        target.terminate()
        assert target.stdout is not None
        said = json.loads(target.stdout.read())
    assert said["sessions"] == 1
    assert said["samples_at_run"] > 0
    assert said["rejected"] == {}
    pressure = read_table_recording(folder / "recordings" / "run").pressure_supply
    assert pressure is not None
    assert pressure.max() > 150e5
    assert pressure[-1] < 50e5


def test_lab_over_a_bridge_to_nobody_says_so_and_ends(ros_domain, tmp_path) -> None:
    bridge = tmp_path / "nobody.yaml"
    bridge.write_text((config_folder() / "bridge" / "emulator.yaml").read_text().replace("47800", "9"))
    started = Started("--headless", "--bridge", str(bridge), "--enabled", "--folder", str(tmp_path))
    started.wait_for("hardware_bridge: no answer from the target at 127.0.0.1:9")
    assert started.end() == 0, started.lines
