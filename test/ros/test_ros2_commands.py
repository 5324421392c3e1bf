"""`./shake ros2 …` beside a node that runs: the lines of the real program, which is asked too where there is one."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator

import pytest
import yaml
from node_process import NodeProcess

from shake_ros.__main__ import main

NODE = "/shake/hardware_bridge"


class Commands:
    """Asks through the package, and through `ros2` where it is installed."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self.capsys = capsys

    def run(self, *arguments: str) -> tuple[int, str, str]:
        code = main(["ros2", *arguments])
        return code, *self.capsys.readouterr()

    def real(self, *arguments: str) -> str:
        done = [
            subprocess.run(["ros2", *one], capture_output=True, text=True, check=False)
            for one in (arguments, ("daemon", "stop"))
        ]
        return done[0].stdout


@pytest.fixture(scope="module")
def node(shared_ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The node that all tests here ask."""
    started = NodeProcess(shared_ros_domain, tmp_path_factory.mktemp("node"), "hardware_bridge")
    started.wait_for("running")
    yield
    assert started.end() == 0


@pytest.fixture
def commands(node: None, capsys: pytest.CaptureFixture[str]) -> Commands:
    return Commands(capsys)


def test_lines_are_those_of_ros2(commands: Commands) -> None:
    assert commands.run("param", "get", NODE, "interlock.span")[:2] == (0, "Double value is: 1.0\n")
    assert commands.run("param", "get", NODE, "bridge", "--hide-type")[:2] == (0, "emulator\n")
    assert commands.run("param", "set", NODE, "interlock.span", "5e-1")[:2] == (0, "Set parameter successful\n")
    assert commands.run("param", "get", NODE, "interlock.span")[:2] == (0, "Double value is: 0.5\n")
    code, _, error = commands.run("param", "set", NODE, "bridge", "other")
    assert (code, error) == (1, "Setting parameter failed: Trying to set a read-only parameter: bridge.\n")
    code, listed, _ = commands.run("topic", "list", "-t")
    assert "/shake/valve_command [sensor_msgs/msg/JointState]" in listed.splitlines()
    code, dumped, _ = commands.run("param", "dump", NODE)
    assert yaml.safe_load(dumped)[NODE]["ros__parameters"]["interlock"]["span"] == 0.5
    code, names, _ = commands.run("param", "list", NODE)
    assert "  interlock.span" in names.splitlines() and names.splitlines() == sorted(names.splitlines())
    code, answer, _ = commands.run("service", "call", "/shake/stop", "std_srvs/srv/Trigger")
    assert code == 0
    assert "requester: making request: std_srvs.srv.Trigger_Request()\n\n" in answer
    assert "response:\nstd_srvs.srv.Trigger_Response(success=True, message='stopped; waiting for reset')\n" in answer
    code, answer, _ = commands.run("service", "call", "/shake/enable", "std_srvs/srv/SetBool", "{data: true}")
    assert "SetBool_Response(success=False, message='stopped; waiting for reset')" in answer
    code, said, _ = commands.run("topic", "echo", "--once", "/diagnostics")
    status = yaml.safe_load(said.removesuffix("---\n"))["status"][0]
    assert status["name"] == "shake/hardware_bridge: hardware_bridge" and status["level"] == 1
    code, rate, _ = commands.run("topic", "hz", "--reports", "1", "/diagnostics")
    assert rate.startswith("average rate: ") and "\n\tmin: " in rate


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("param", "get", "/nowhere", "rate"), "Node not found"),
        (("param", "get", NODE, "foo"), "Parameter not set"),
        (("topic", "echo", "/nothing"), "topic [/nothing] does not appear to be published yet"),
        (("service", "call", "/shake/stop", "std_srvs/srv/Nothing"), "The passed service type is invalid"),
        (("service", "call", "/shake/enable", "std_srvs/srv/SetBool", "{dat: true}"), "Failed to populate field"),
    ],
)
def test_what_cannot_be_asked_is_one_line_and_exit_code_2(commands: Commands, arguments, reason) -> None:
    code, _, error = commands.run(*arguments)
    assert code == 2
    assert reason in error and len(error.splitlines()) == 1


@pytest.mark.skipif(shutil.which("ros2") is None, reason="the real ros2 program is not installed here")
@pytest.mark.parametrize(
    "arguments",
    [
        ("topic", "list", "-t"),
        ("param", "list", NODE),
        ("param", "dump", NODE),
        ("param", "get", NODE, "interlock.span"),
        ("param", "set", NODE, "interlock.span", "0.7"),
        ("service", "call", "/shake/stop", "std_srvs/srv/Trigger"),
    ],
)
def test_real_program_says_the_same(commands: Commands, arguments) -> None:
    waiting = "waiting for service to become available...\n"
    ours, real = commands.run(*arguments)[1], commands.real(*arguments)
    assert ours.removeprefix(waiting) == real.removeprefix(waiting)
