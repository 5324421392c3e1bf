"""Random and broken datagrams against both ends of the bridge's link: nothing but a counted refusal may come of them.

    python -m benchmarks.bridge.fuzz [--count 100000] [--seed 1]

Each datagram goes through a real socket into a target (as commands do) and into a host (as measurements do), many of
them sealed with the right key, so that they reach the last check. Exit status 0 where every one was refused and
counted, or was taken as what its seal says.
"""

from __future__ import annotations

import argparse
import random
import socket
import sys
import time

from shake_ros.bridge import wire
from shake_ros.bridge.ends import Host, TargetLink
from shake_ros.bridge.wire import vectors

KEY = bytes(range(32))
BATCH = 32  # datagrams between two looks, fewer than a socket holds
SAMPLE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0.0, 0, 0)


def broken(generator: random.Random, patterns: list[bytes], session_key: bytes) -> bytes:
    """A datagram: noise, a changed good one, a shortened or a lengthened one; at times sealed again."""
    if generator.random() < 0.2:
        return generator.randbytes(generator.randrange(0, 700))
    data = bytearray(generator.choice(patterns))
    for _ in range(generator.randrange(1, 9)):
        data[generator.randrange(len(data))] = generator.randrange(256)
    if generator.random() < 0.5:
        data[:8] = generator.choice(patterns)[:8]
    if generator.random() < 0.2:
        return bytes(data[: generator.randrange(len(data))])
    if generator.random() < 0.5:
        body = bytes(data[: -wire.TAG_SIZE])
        return body + wire.tag(generator.choice((KEY, session_key)), body)
    return bytes(data)


def connected() -> tuple[Host, TargetLink]:
    """Both ends with a session between them."""
    target = TargetLink("127.0.0.1", 0, KEY)
    host = Host("127.0.0.1", target.address[1], "127.0.0.1", KEY)
    deadline = time.monotonic() + 5.0
    while target.session is None:
        host.receive(0.01)
        target.commands()
        if time.monotonic() > deadline:
            raise RuntimeError("no session")
    return host, target


def fuzz(count: int, seed: int) -> tuple[int, dict[str, int], dict[str, int]]:
    """Send `count` datagrams to each end; returns how many were taken, and what each end refused."""
    generator = random.Random(seed)
    host, target = connected()
    attacker = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    port = host._socket.getsockname()[1]
    taken = 0
    try:
        for done in range(0, count, BATCH):
            session = target.session
            assert session is not None
            patterns = [
                *list(vectors().values())[1:3],
                wire.command(session.key, wire.Command(session.number, done + 5, 1, 0.5, 3, 0)),
                wire.measurement(session.key, wire.TableDatagram(session.number, done + 5, done, *SAMPLE)),
            ]
            for _ in range(min(BATCH, count - done)):
                data = broken(generator, patterns, session.key)
                attacker.sendto(data, target.address)
                attacker.sendto(data, ("127.0.0.1", port))
            while (came := target.commands()) or host.receive(0.0) is not None:
                taken += len(came)
        return taken, dict(target.rejected), dict(host.rejected)
    finally:
        attacker.close()
        host.close()
        target.close()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--count", type=int, default=100_000, help="datagrams to each end")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    started = time.monotonic()
    taken, by_target, by_host = fuzz(given.count, given.seed)
    elapsed = time.monotonic() - started
    for name, rejected in (("target", by_target), ("host", by_host)):
        listed = ", ".join(f"{reason} {number}" for reason, number in rejected.items() if number)
        print(f"{name}: {given.count} datagrams, {sum(rejected.values())} refused ({listed})")
    print(f"{taken} sealed with the session's key were taken; no other exception; {elapsed:.1f} s")
    return 0 if sum(by_target.values()) > given.count // 2 and sum(by_host.values()) > given.count // 2 else 1


if __name__ == "__main__":
    sys.exit(main())
