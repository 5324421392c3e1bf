"""A drive on the table of a running graph: played and recorded whole, the loop exchanged, refusals in one line."""

from __future__ import annotations

from argparse import Namespace

import numpy as np
import pytest
from lab_process import QUICK, Started

from shake_ros.__main__ import main
from shake_ros.api.close_loop import _halves
from shake_ros.api.live_table import InterlockHeldError, LiveLaboratory, write_loop
from shake_ros.cli import repair
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.reference.baseline import states_from_rest
from shake_ros.control.reference.motion import Envelope
from shake_ros.experiment_design import next_recording as designs
from shake_ros.experiment_design.design import PredictedExcitation, Separation
from shake_ros.experiment_design.motions import Excitation
from shake_ros.experiment_design.next_recording import NextRecording
from shake_ros.failures import Failures
from shake_ros.fit.records import Record
from shake_ros.quantities import ShakeError
from shake_ros.ros.interface import VALVE_COMMAND
from shake_ros.ros.live_table import live_table
from shake_ros.safety.causes import InterlockParameters
from shake_ros.settings import load_table, load_variant

DT = 0.001


def drive(size: float = 2e-3) -> np.ndarray:
    """Half a second that begins and ends at rest, (n, 3)."""
    t = np.linspace(0.0, 0.5, 501)
    position = size * (t * (0.5 - t) / 0.0625) ** 4
    return states_from_rest(np.gradient(np.gradient(position, t), t), DT)


def refused(capsys: pytest.CaptureFixture[str], tmp_path) -> str:
    assert main(["qualify", "ac156", "--live", "--out", str(tmp_path / "out"), "--acknowledge", "me"]) == 2
    assert not (tmp_path / "out").exists()
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_without_a_graph_nothing_is_made(ros_domain, tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.setattr("shake_ros.ros.live_table.LOOK", 0.5)
    assert f"no graph runs under /shake in ROS domain {ros_domain}" in refused(capsys, tmp_path)


def test_drive_is_played_on_an_enabled_table_alone_and_recorded_whole(ros_domain, tmp_path, capsys) -> None:
    started = Started("--headless", "--lockstep", "--composed", *QUICK, "--folder", str(tmp_path))
    with started:
        started.wait_for("running: loop")
        assert "the table is not ready to move: not enabled; enable it" in refused(capsys, tmp_path)
        assert main(["ros2", "service", "call", "/shake/enable", "std_srvs/srv/SetBool", "{data: true}"]) == 0
        with live_table() as table:
            assert "simulated, bergamo, lock-step, interlock bergamo" in table.words
            laboratory = LiveLaboratory(table)
            run = laboratory.play(load_table("bergamo"), drive(), "run_1", 0)
            assert len(run) == 501 and run.pressure_supply is not None
            assert np.std(run.position - drive()[:, 0]) < 0.2 * np.std(drive()[:, 0])
            observer, controller = (
                load_variant(kind, name, family)
                for kind, name, family in (
                    ("observer", "model", OBSERVERS), ("controller", "feedforward_pi_tuned", CONTROLLERS)
                )
            )  # fmt: skip
            table.carry(*write_loop(tmp_path / "loop", load_table("bergamo"), observer, controller))
            assert table.graph.until(lambda: table.loop == "feedforward_pi, model", 5.0)
            table.limit({"velocity": 0.025})
            with pytest.raises(InterlockHeldError, match=r"the interlock held the table: velocity") as held:
                table.play(drive(8e-3), "run_2")
            assert (held.value.bag / "metadata.yaml").is_file()
            with pytest.raises(ShakeError, match=r"not ready to move: .*velocity.*; find its cause, then"):
                table.check()
            table.graph.node.create_publisher(VALVE_COMMAND.type, VALVE_COMMAND.name, VALVE_COMMAND.qos(True))
            table.graph.until(lambda: table.graph.commanders > 1, 5.0)
            with pytest.raises(ShakeError, match=r"two commanders: 2 nodes publish on /shake/valve_command"):
                table.check()
        assert "the pressure is off" in capsys.readouterr().out
        assert started.end() == 0


class Answer:
    """What a search has found, which goes on with recordings that it keeps."""

    failures = Failures()

    def __init__(self) -> None:
        self.recordings: list = []

    def extended(self, recording, **_):
        self.recordings.append(recording)
        return self

    def report(self, folder, **_):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "report.json").write_text("{}")
        return folder


def test_what_a_design_asks_for_is_released_played_recorded_and_decided_upon(ros_domain, tmp_path, monkeypatch, capsys):
    wanted = Excitation("sine", "sine", 4.0, 0.0, 0.1, 4.0)
    limits, like = Envelope(0.02, 0.2, 3.0), Record("like", DT, np.zeros(99), np.zeros(99))

    def asked(found: Answer, *, interlock: InterlockParameters, **_) -> NextRecording:
        assert (interlock.limits["velocity"], interlock.full_speed) == (1.5, 0.63)
        gain = 0.0 if found.recordings else 9.0
        shown = PredictedExcitation(
            wanted, wanted.samples(limits, DT), like, (Separation("other", gain, np.zeros(99)),)
        )
        return NextRecording(("other",), shown, limits, DT, answers=(("a",), ("b",)))

    monkeypatch.setattr(designs, "next_recording", asked)
    found, out = Answer(), tmp_path / "out"
    found.report(out)
    given = Namespace(
        live=True,
        namespace="/shake",
        out=out,
        acknowledge="me",
        most=2,
        minutes=None,
        force=False,
        figures=None,
        line="",
    )
    with Started("--headless", "--lockstep", "--composed", "--enabled", *QUICK, "--folder", str(tmp_path)) as started:
        started.wait_for("running: loop")
        answers = [found]
        repair.decide_live(answers, given)
        assert started.end() == 0
    assert answers == [found, found]
    (run,) = found.recordings[0]
    first, second = _halves(found.recordings[0].records("valve_command"))
    asked_for = np.std(wanted.samples(limits, DT)[500:2000, 0])
    for half in (first[0].position[-1500:], second[0].position[:1500]):  # the rest before and after is in neither
        assert np.std(half) == pytest.approx(asked_for, rel=0.4)
    assert run.name == "next_1" and (out / "recordings" / "next_1" / "metadata.yaml").is_file()
    assert (out / "next" / "drive.yaml").is_file() and not (out / "decided" / "next" / "drive.yaml").exists()
    said = capsys.readouterr().out
    assert "distinguishes other: expected odds 8 103 : 1" in said
    assert "settles anything with the sensors of this table" in said
