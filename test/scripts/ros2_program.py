"""What a ROS user does, with the real `ros2`, colcon and launch: build, run, remap, look, set, dump, load, launch, end.

    python test/scripts/ros2_program.py [--domain 0] [--colcon colcon] [--keep FOLDER]

Needs the `ros2` program on the PATH; says so and ends with 3 where there is none. With colcon the package is built in a
workspace of its own first, by copy and by --symlink-install, and its tests are found; without, `ros2 run` takes the
installation that is sourced. Exit status 0 where every step went as it should.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT = 300.0  # for what a node is to say; the first start compiles [s]
NONE = 3  # exit status without the program
TOLD = 0, 1, 2, 15  # that of `ros2 topic` after Ctrl-C, by where that meets it: those that were seen
NODES = ("plant", "hardware_bridge", "reference_generator", "observer", "controller", "thd_analyzer", "recorder")


class User:
    """Who types the commands.

    Parameters
    ----------
    folder : of what is written. domain : of all that runs.
    """

    def __init__(self, folder: Path, domain: int) -> None:
        self.folder = folder
        self.environment = {
            **os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"
        }  # fmt: skip
        self._count = 0

    def types(self, *command: str, fails: bool = False, timeout: float = TIMEOUT) -> str:
        """Run a command to its end; what it printed."""
        done = subprocess.run(
            command,
            env=self.environment,
            cwd=self.folder,
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )
        assert fails or done.returncode == 0, f"{' '.join(command)}: {done.returncode}\n{done.stdout}\n{done.stderr}"
        return done.stdout + done.stderr

    def ros2(self, *words: str, fails: bool = False) -> str:
        """One `ros2` command."""
        return self.types("ros2", *words, fails=fails)

    def tries(self, text: str, *words: str) -> str:
        """A `ros2` command again and again until it says `text`: what has just started is discovered in a while."""
        deadline = time.monotonic() + TIMEOUT
        while text not in (said := self.ros2(*words, fails=True)):
            assert time.monotonic() < deadline, f"ros2 {' '.join(words)} does not say '{text}': {said}"
        return said

    @contextlib.contextmanager
    def terminal(self, *words: str, ends: tuple[int, ...] = (0,)) -> Iterator[Terminal]:
        """A `ros2` command that goes on in the block; at its end Ctrl-C, which the whole group gets."""
        self._count += 1
        made = Terminal(self.folder / f"terminal_{self._count}.txt", words, self)
        try:
            yield made
            code = made.interrupt()
            assert code in ends, f"ros2 {' '.join(words)}: {code}\n{made.said()}"
        finally:
            made.kill()

    @contextlib.contextmanager
    def node(self, name: str, *arguments: str) -> Iterator[Terminal]:
        """`ros2 run shake_ros NAME` until the end of the block."""
        with self.terminal("run", "shake_ros", name, "--ros-args", *arguments) as made:
            made.waits_for("running")
            yield made


class Terminal:
    """A command that goes on, with all that it starts."""

    def __init__(self, path: Path, words: tuple[str, ...], user: User) -> None:
        self.path = path
        with path.open("wb") as log:
            self.process = subprocess.Popen(
                ["ros2", *words], env=user.environment, cwd=user.folder, stdout=log, stderr=log, start_new_session=True
            )

    def said(self) -> str:
        return self.path.read_text(errors="replace")

    def waits_for(self, text: str) -> None:
        deadline = time.monotonic() + TIMEOUT
        while text not in self.said():
            assert time.monotonic() < deadline and self.process.poll() is None, f"not said: '{text}'\n{self.said()}"
            time.sleep(0.05)

    def interrupt(self) -> int:
        """Ctrl-C; the exit code."""
        os.killpg(self.process.pid, signal.SIGINT)
        return self.process.wait(40.0)

    def kill(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


def build(user: User, colcon: str) -> None:
    """colcon build by copy and by --symlink-install, colcon test; the last installation is sourced."""
    source = user.folder / "src"
    source.mkdir()
    (source / "shake_ros").symlink_to(ROOT)
    for options in ([], ["--symlink-install"]):
        for name in ("build", "install", "log"):
            shutil.rmtree(user.folder / name, ignore_errors=True)
        said = user.types(colcon, "build", *options, "--packages-select", "shake_ros", timeout=300.0)
        assert "1 package finished" in said, said
        for name in NODES:
            assert os.access(user.folder / "install" / "shake_ros" / "lib" / "shake_ros" / name, os.X_OK), name
    found = user.types(
        colcon, "test", "--packages-select", "shake_ros", "--pytest-args", "test/test_packaging.py", timeout=300.0
    )
    assert "1 package finished" in found, found
    result = user.types(colcon, "test-result", "--verbose")
    assert re.search(r"[1-9]\d* tests, 0 errors, 0 failures", result), result
    sourced = user.types("bash", "-c", ". install/local_setup.bash && env -0")
    user.environment |= dict(line.split("=", 1) for line in sourced.split("\0") if "=" in line)


def package(user: User) -> None:
    """`ros2 pkg` finds the package and its executables; `--help` names parameters, topics and services."""
    assert set(NODES) <= {line.split()[-1] for line in user.ros2("pkg", "executables", "shake_ros").splitlines()}
    assert "<license" in user.ros2("pkg", "xml", "shake_ros")
    share = Path(user.ros2("pkg", "prefix", "--share", "shake_ros").strip())
    assert (share / "config" / "description" / "shaking_table.urdf").is_file()
    said = user.ros2("run", "shake_ros", "plant", "--help")
    assert "supply.supply_pressure" in said and "joint_states" in said and "enable" in said, said


def safety(user: User) -> None:
    """Remapped names: second commander, stop, refused enable, command without a stamp, each on the console."""
    remapped = ("-r", "valve_command:=/cmd/valve", "-r", "__ns:=/rig", "-r", "__node:=table")
    with user.node("plant", *remapped, "-p", "interlock.causes.stale_command.threshold:=5.0") as plant:
        message = "{header: {stamp: {sec: 0}}, name: [servo_valve], position: [0.01]}"
        user.ros2("topic", "pub", "-t", "3", "-w", "1", "/cmd/valve", "sensor_msgs/msg/JointState", message)
        plant.waits_for("no stamp (header.stamp is 0)")
        command = ("topic", "pub", "-r", "50", "/cmd/valve", "sensor_msgs/msg/JointState")
        stamped = "{header: auto, name: [servo_valve], position: [0.01]}"
        with user.terminal(*command, stamped, ends=TOLD), user.terminal(*command, stamped, ends=TOLD):
            plant.waits_for("two_commanders: ")
        assert "success=True" in user.ros2("service", "call", "/rig/stop", "std_srvs/srv/Trigger")
        plant.waits_for("waits for reset")
        request = ("service", "call", "/rig/enable", "std_srvs/srv/SetBool", "{data: true}")
        assert "success=False" in user.ros2(*request)
        user.tries("success=True", "service", "call", "/rig/reset", "std_srvs/srv/Trigger")
        plant.waits_for("reset: ")


def second_graph(user: User) -> None:
    """A second plant of the same names ends at once with one line and exit code 2."""
    with user.node("plant"):
        done = user.ros2("run", "shake_ros", "plant", fails=True)
        assert "node /shake/plant runs already, by process" in done, done


def parameters(user: User) -> None:
    """Numbers as people write them, live references, another law, and dump → load → the same for every node."""
    with user.node("plant"):
        said = user.tries("successful", "param", "set", "/shake/plant", "supply.supply_pressure", "1.8e7")
        assert "Set parameter successful" in said
        assert "18000000.0" in user.ros2("param", "get", "/shake/plant", "supply.supply_pressure")
    with user.node("reference_generator"):
        user.tries("successful", "param", "set", "/shake/reference_generator", "reference", "sine_20mm_2hz")
        assert "successful" in user.ros2("param", "set", "/shake/reference_generator", "amplitude", "0.01")
    with user.node("controller"):
        user.tries("successful", "param", "set", "/shake/controller", "controller", "pid")
        assert "proportional" in user.ros2("param", "list", "/shake/controller")
    for name in NODES:
        own = ("-p", f"output:={user.folder / 'dumped'}", "-p", "force:=true") if name == "recorder" else ()
        path, dumps = user.folder / f"{name}.yaml", []
        for given in (own, ("--params-file", str(path))):
            with user.node(name, *given):
                dumps.append(user.tries("ros__parameters", "param", "dump", f"/shake/{name}"))
            path.write_text(dumps[0])
        assert yaml.safe_load(dumps[0]) == yaml.safe_load(dumps[1]), name


def messages(user: User) -> None:
    """Frames, covariance, joint names, rates and harmonics of a loop in lock-step, which no busy machine trips."""
    loop = [
        ("reference_generator", "-p", "reference:=sine_20mm_2hz"),
        ("observer",),
        ("controller",),
        ("thd_analyzer",),
    ]
    with contextlib.ExitStack() as stack:
        for name, *given in [*loop, ("plant",)]:
            stack.enter_context(user.node(name, *given, "-p", "lockstep:=true"))
        assert user.tries("table", "topic", "echo", "--once", "/shake/imu", "--field", "header.frame_id")
        variance = user.ros2("topic", "echo", "--once", "/shake/imu", "--field", "linear_acceleration_covariance")
        assert float(re.findall(r"[\d.e-]+", variance)[0]) > 0.0, variance
        assert "table" in user.ros2("topic", "echo", "--once", "/shake/joint_states", "--field", "name")
        user.tries("THD", "topic", "echo", "--once", "/shake/thd")
        with user.terminal("topic", "hz", "/shake/joint_states", ends=TOLD) as rate:
            rate.waits_for("average rate")


def quality(user: User) -> None:
    """`qos_overrides` from the command line: seen by `ros2 topic info`, refused where lock-step would lose samples."""
    reliability = ("-p", "qos_overrides./shake/imu.publisher.reliability:=best_effort")
    with user.node("plant", *reliability):
        said = user.tries("Node name: plant", "topic", "info", "-v", "/shake/imu")
        assert "Reliability: BEST_EFFORT" in said, said
    arguments = ("run", "shake_ros", "plant", "--ros-args", *reliability, "-p", "lockstep:=true")
    refused = user.ros2(*arguments, fails=True)
    assert "in lock-step imu is reliable and keeps all" in refused, refused


def simulated_time(user: User) -> None:
    """A recording played with its clock, by `ros2 bag play --clock` where it is, else by our player, is the time."""
    bag = user.folder / "timed"
    with user.node("plant"), user.node("recorder", "-p", f"output:={bag}"):
        time.sleep(5.0)
    content = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    begin = content["starting_time"]["nanoseconds_since_epoch"]
    end = begin + content["duration"]["nanoseconds"]
    if "bag" in user.ros2("--help").split():
        player = user.terminal("bag", "play", "--clock", "100", "--loop", str(bag), ends=TOLD)
    else:
        print("  NOT TESTED with `ros2 bag play`: there is none here; with the package's own player", flush=True)
        own = ("-p", f"input:={bag}", "-p", "loop:=true", "-p", "clock_rate:=100.0")
        player = user.terminal("run", "shake_ros", "player", "--ros-args", *own)
    with user.node("reference_generator", "-p", "use_sim_time:=true"), player:
        said = user.tries("nanosec", "topic", "echo", "--once", "/shake/reference", "--field", "header.stamp")
    second = int(re.findall(r"sec: (\d+)", said)[0])
    assert begin // 10**9 <= second <= end // 10**9, (begin, second, end)


def launch(user: User) -> None:
    """`ros2 launch` starts the graph, records it, and ends it in good order."""
    bag = user.folder / "launched"
    with user.terminal("launch", "shake_ros", "table.launch.py", "reference:=sine_20mm_2hz", f"record:={bag}") as made:
        made.waits_for("recording to")
        user.tries("positions", "topic", "echo", "--once", "/shake/estimate")
        time.sleep(2.0)
    assert made.said().count("process has finished cleanly") == 6, made.said()
    content = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert content["message_count"] > 1000 and content["storage_identifier"] == "mcap"


STEPS = (package, safety, second_graph, parameters, quality, simulated_time, messages, launch)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    parser.add_argument("--colcon", default=shutil.which("colcon"), help="the program; none: what is sourced is used")
    parser.add_argument("--keep", type=Path, help="work in this new folder and leave it")
    parser.add_argument("--step", action="append", choices=[one.__name__ for one in STEPS], help="only this one")
    given = parser.parse_args()
    if shutil.which("ros2") is None:
        print("NOT TESTED: there is no `ros2` program here; source a ROS 2 installation", file=sys.stderr)
        return NONE
    with contextlib.ExitStack() as stack:
        folder = given.keep or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        folder.mkdir(parents=True, exist_ok=True)
        user = User(folder, given.domain)
        stack.callback(user.ros2, "daemon", "stop", fails=True)
        if given.colcon:
            print("build: colcon build, colcon build --symlink-install, colcon test", flush=True)
            build(user, given.colcon)
        for step in STEPS:
            if not given.step or step.__name__ in given.step:
                begun = time.monotonic()
                print(f"{step.__name__}: {step.__doc__}", flush=True)
                step(user)
                print(f"  as it should be, {time.monotonic() - begun:.0f} s", flush=True)
    print("the real programs did all of it")
    return 0


if __name__ == "__main__":
    sys.exit(main())
