"""What the table answers to bad commands, to stop and reset, and to parameters out of range, in real time.

    python test/scripts/bad_commands.py [--domain 0]

Starts the plant alone and drives it. Exit status 0 where every answer is as it should be.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.realtime.driver import Driver
from benchmarks.realtime.listener import Listener
from shake_ros.ros.graph import Graph, NodeSpec

TIMEOUT = 15.0  # for a state on /diagnostics [s]
STILL = 2e-3  # a table in safe hold is slower than this [m/s] …
RAMP = 1.0  # … once the command has ramped to zero, which is said when it begins [s]


class Scene:
    """The plant, who drives it and who listens."""

    def __init__(self, driver: Driver, listener: Listener) -> None:
        self.driver = driver
        self.listener = listener

    def expect(self, text: str) -> dict[str, str]:
        """Wait until the plant's status says `text`."""
        status = self.listener.wait_for_status("plant", text, TIMEOUT)
        print(f"  plant: {status['message']}")
        return status

    def speed(self) -> float:
        """Present speed of the table [m/s]."""
        return abs(self.listener.messages("truth")[-1].points[0].velocities[0])

    def comes_to_rest(self, when: str) -> None:
        """Soon, and as it is said."""
        deadline = time.monotonic() + RAMP
        while (speed := self.speed()) >= STILL:
            assert time.monotonic() < deadline, f"{speed} m/s {when}"
            time.sleep(0.01)

    def run(self) -> None:
        """From any hold back to motion."""
        self.driver.command(0.02)
        self.expect("running")


def stale_command(scene: Scene) -> None:
    """Without commands the table goes to a safe hold, and on again when they are back."""
    scene.driver.hold()
    scene.expect("safe hold: no command for")
    scene.comes_to_rest("in safe hold")
    scene.run()


def not_a_number(scene: Scene) -> None:
    """NaN is refused and counted; the last good command is held, then the safe hold."""
    before = int(scene.listener.status("plant")["valve_command.refused"])
    scene.driver.command(math.nan)
    status = scene.expect("safe hold: no command for")
    assert int(status["valve_command.refused"]) > before
    scene.run()


def two_publishers(scene: Scene) -> None:
    """A second publisher takes the table to a safe hold, until it is gone and the table is reset."""
    second = scene.driver.new_publisher()
    scene.expect("2 publishers on /shake/valve_command")
    time.sleep(0.5)
    scene.comes_to_rest("in safe hold")
    success, message = scene.driver.service("reset")
    assert not success, f"reset although two publish: {message}"
    scene.driver.node.destroy_publisher(second)
    deadline = time.monotonic() + TIMEOUT
    while not scene.driver.service("reset")[0]:
        assert time.monotonic() < deadline, "no reset although one publishes"
        time.sleep(0.1)
    scene.run()


def stop_and_reset(scene: Scene) -> None:
    """`stop` holds the table in spite of commands; `reset` lets it go on; `enable` false and true likewise."""
    for hold, release, text in (
        (("stop", {}), ("reset", {}), "stopped; waiting for reset"),
        (("enable", {"data": False}), ("enable", {"data": True}), "not enabled"),
    ):
        assert scene.driver.service(hold[0], **hold[1])[0]
        scene.expect(text)
        scene.comes_to_rest(f"when {text}")
        assert scene.driver.service(release[0], **release[1])[0]
        scene.expect("running")


def parameters(scene: Scene) -> None:
    """A live parameter is taken; out of range, read-only and unknown are refused with the reason."""
    for name, value, accepted, reason in (
        ("body.specimen_mass", 350.0, True, ""),
        ("supply.supply_pressure", 1.0, False, "out of range"),
        ("body.stroke", 0.3, False, "read-only"),
        ("no_such_parameter", 1.0, False, "undeclared"),
    ):
        success, message = scene.driver.set_parameter(name, value)
        print(f"  {name} = {value}: {'taken' if success else message}")
        assert success == accepted, message
        assert reason in message, message


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    domain = parser.parse_args().domain
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    topics = ("truth", "/diagnostics")
    # a slow machine must not make a good command stale
    plant = NodeSpec("plant", {"interlock.causes.stale_command.threshold": 0.3})
    with (
        Listener(topics, lockstep=False, domain_id=domain) as listener,
        Graph([plant], domain_id=domain, lockstep=False) as graph,
        Driver(domain_id=domain) as driver,
    ):
        graph.wait_until_ready()
        scene = Scene(driver, listener)
        scene.expect("waiting for the first command")
        scene.run()
        for act in (stale_command, not_a_number, two_publishers, stop_and_reset, parameters):
            print(act.__doc__.splitlines()[0] if act.__doc__ else act.__name__)
            act(scene)
            graph.check()
    print("every answer as it should be")
    return 0


if __name__ == "__main__":
    sys.exit(main())
