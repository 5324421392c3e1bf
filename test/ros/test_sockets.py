"""What a running graph listens on: nothing that another machine could reach."""

from __future__ import annotations

import os
from pathlib import Path

from shake_ros.ros.graph import Graph, NodeSpec

LOOPBACK = {"0100007F", "00000000000000000000000001000000", "0000000000000000FFFF00000100007F"}
LISTENING = "0A"  # state of a TCP socket
MOST_SENDERS = 2  # sockets that Fast DDS opens to send from
TABLES = ("udp", "udp6", "tcp", "tcp6")


def sockets(process: int) -> list[tuple[str, str, int]]:
    """Protocol, local address and port of each socket that a process receives on."""
    inodes = set()
    for descriptor in os.listdir(f"/proc/{process}/fd"):
        target = os.readlink(f"/proc/{process}/fd/{descriptor}")
        if target.startswith("socket:["):
            inodes.add(target[8:-1])
    found = []
    for table in TABLES:
        path = Path(f"/proc/{process}/net/{table}")
        for line in path.read_text().splitlines()[1:] if path.is_file() else ():
            fields = line.split()
            address, port = fields[1].split(":")
            if fields[9] in inodes and (table.startswith("udp") or fields[3] == LISTENING):
                found.append((table, address, int(port, 16)))
    return found


def test_nodes_listen_on_loopback_only(ros_domain) -> None:
    first = 7400 + 250 * ros_domain
    sensors = ("joint_states", "imu", "pressure_a", "pressure_b", "pressure_supply")
    apart = {topic: f"other/{topic}" for topic in sensors}  # the plant has the topics
    nodes = [NodeSpec("plant"), NodeSpec("hardware_bridge", remaps=apart), NodeSpec("controller")]
    with Graph(nodes, domain_id=ros_domain, lockstep=False) as graph:
        graph.wait_until_ready()
        for name, process in graph.processes.items():
            open_ones = sockets(process.pid)
            local = [one for one in open_ones if one[1] in LOOPBACK]
            beyond = [one for one in open_ones if one[1] not in LOOPBACK]
            assert any(first <= port < first + 250 for _, _, port in local), name
            assert all(table.startswith("udp") for table, _, _ in beyond), (name, beyond)
            assert not [one for one in beyond if first <= one[2] < first + 250], (name, beyond)
            assert len(beyond) <= MOST_SENDERS, (name, beyond)
