"""The server for Foxglove: what a client of its own gets, how much of it, and from where."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
from every_node import built
from websockets.sync import client

from shake_ros.quantities import ShakeError
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND, codec


@pytest.fixture
def context() -> Iterator[rclpy.Context]:
    own = rclpy.Context()
    rclpy.init(context=own)
    yield own
    own.try_shutdown()


def test_client_gets_a_thinned_copy_byte_for_byte(context: rclpy.Context, tmp_path: Path) -> None:
    node: Any = built("foxglove", context, tmp_path, "-p", "port:=0", "-p", "passed_rate:=5.0")
    node.start()
    try:
        address = f"ws://127.0.0.1:{node._server.port}"
        with client.connect(address, subprotocols=["foxglove.sdk.v1"]) as socket:
            channels: dict[str, dict[str, Any]] = {}
            while "/shake/imu" not in channels or "/diagnostics" not in channels:
                message = json.loads(socket.recv(timeout=10))
                channels |= {c["topic"]: c for c in message.get("channels", [])}
            imu = channels["/shake/imu"]
            assert (imu["encoding"], imu["schemaName"]) == ("cdr", "sensor_msgs/msg/Imu")
            assert "geometry_msgs/Vector3 linear_acceleration" in imu["schema"]
            wanted = {"op": "subscribe", "subscriptions": [{"id": 7, "channelId": imu["id"]}]}
            socket.send(json.dumps(wanted))
            thinned = next(t for t in node.topics if t.channel.topic() == "/shake/imu")
            data = codec(interface.IMU).encode(3 * SECOND, (1.25,))
            got = None
            for _ in range(100):  # the subscription may take a moment to arrive
                thinned.arrived(bytes(data))
                try:
                    got = socket.recv(timeout=0.05)
                    break
                except TimeoutError:
                    continue
            assert isinstance(got, bytes)
            opcode, subscription, _ = struct.unpack_from("<BIQ", got)
            assert (opcode, subscription) == (1, 7)
            assert got[13:] == bytes(data)
            before = thinned.passed
            for _ in range(1000):
                thinned.arrived(bytes(data))
            assert thinned.passed - before <= 3
    finally:
        node.finish()
        node.frame.close()


def test_it_listens_on_this_machine_alone(context: rclpy.Context, tmp_path: Path) -> None:
    with pytest.raises(ShakeError, match="not this machine alone"):
        built("foxglove", context, tmp_path, "-p", "host:=0.0.0.0")
