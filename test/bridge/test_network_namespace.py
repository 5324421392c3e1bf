"""Host and emulator as processes over a link that the kernel makes bad: `tc netem` in a network namespace."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NETEM = "delay 300us 100us loss 2% duplicate 1% corrupt 1% reorder 2% 50%"

SCENE = """
    import json, subprocess, sys, time
    from shake_ros.bridge.ends import Host
    emulator = subprocess.Popen(
        [sys.executable, "-m", "shake_ros", "target_emulator", "--port", "0"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )
    port = int(emulator.stdout.readline().rsplit(":", 1)[1])
    host = Host("127.0.0.1", port, "127.0.0.1", b"")
    until, status = time.monotonic() + 6.0, 0
    while time.monotonic() < until:
        came = host.receive(0.002)
        if came is not None:
            status = came[0].status
            host.send(came[0].sequence, 0.0, 3, 0)
    emulator.terminate()
    found = json.loads(emulator.stdout.read())
    found |= {"stage": status & 3, "host": host.rejected, "lost": host.lost, "received": host.received}
    print(json.dumps(found))
"""


@pytest.fixture
def namespace() -> list[str]:
    """The command that runs a program in a namespace with a bad loopback link; skipped where that cannot be had."""
    if os.geteuid() != 0:
        pytest.skip("a network namespace with `tc netem` needs root")
    for program in ("unshare", "ip", "tc"):
        if shutil.which(program) is None:
            pytest.skip(f"needs the program `{program}`, which is not here")
    inside = [
        "unshare",
        "--net",
        "sh",
        "-c",
        f'ip link set lo up && tc qdisc add dev lo root netem {NETEM} && exec "$@"',
    ]
    command = [*inside, "sh"]
    tried = subprocess.run([*command, "true"], capture_output=True, text=True, check=False)
    if tried.returncode:
        pytest.skip(f"no `tc netem` on this machine: {tried.stderr.strip()}")
    return command


@pytest.mark.second_tier
@pytest.mark.alone
def test_session_holds_over_a_link_with_delay_loss_duplicates_corruption_and_reordering(namespace) -> None:
    done = subprocess.run(
        [*namespace, sys.executable, "-c", textwrap.dedent(SCENE)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=120.0,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["stage"] == 3
    assert found["lost"] > 0 and found["received"] > 1000
    assert found["host"]["replay"] > 0
    assert not [trip for trip in found["trips"] if trip["cause"] == "command_lost"]
