"""Datagrams: their layout to the byte, and what is refused."""

from __future__ import annotations

import hashlib
import hmac
import random
import re
import struct
import subprocess
from pathlib import Path

import pytest

from shake_ros.bridge import wire
from shake_ros.bridge.wire import (
    HOST_NONCE,
    TARGET_NONCE,
    WORKED_COMMAND,
    WORKED_MEASUREMENT,
    ReplayWindow,
    key_for,
    read_key,
    session_key,
    vectors,
    write_key,
)
from shake_ros.bridge.wire import (
    WORKED_KEY as KEY,
)
from shake_ros.quantities import ShakeError

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reference" / "datagrams.md"
FUZZED = 3000  # here; benchmarks/bridge/fuzz.py takes 100 000


def reason(data: bytes, key: bytes = KEY) -> str:
    """Why a datagram is refused; empty where it is taken."""
    readers = {
        wire.HELLO: wire.read_hello,
        wire.WELCOME: wire.read_welcome,
        wire.MEASUREMENT: wire.read_measurement,
        wire.COMMAND: wire.read_command,
    }
    try:
        readers[wire.header(data).kind](key, data)
    except wire.Rejected as rejected:
        return str(rejected)
    return ""


def test_layout_is_what_the_page_says_to_the_byte() -> None:
    key = session_key(KEY, HOST_NONCE, TARGET_NONCE)
    data = wire.measurement(key, WORKED_MEASUREMENT)
    m = WORKED_MEASUREMENT
    assert data[:8] == b"SHK1" + bytes([1, 3]) + struct.pack("<H", 120)
    assert struct.unpack_from("<QQq", data, 8) == (m.session, m.sequence, m.target_time)
    assert struct.unpack_from("<6d", data, 32) == m[3:9]
    assert struct.unpack_from("<QdII", data, 80) == m[9:]
    assert data[104:] == hmac.new(key, data[:104], hashlib.sha256).digest()[:16]
    data = wire.command(key, WORKED_COMMAND)
    assert struct.unpack_from("<QdBB", data, 24) == WORKED_COMMAND[2:]
    assert data[42:48] == bytes(6)
    assert data[48:] == hmac.new(key, data[:48], hashlib.sha256).digest()[:16]


def test_what_is_sealed_is_read_again() -> None:
    assert wire.read_measurement(KEY, wire.measurement(KEY, WORKED_MEASUREMENT)) == WORKED_MEASUREMENT
    assert wire.read_command(KEY, wire.command(KEY, WORKED_COMMAND)) == WORKED_COMMAND
    assert wire.read_hello(KEY, wire.hello(KEY, HOST_NONCE)) == HOST_NONCE
    assert wire.read_welcome(KEY, wire.welcome(KEY, 5, HOST_NONCE, TARGET_NONCE)) == (
        HOST_NONCE,
        TARGET_NONCE,
    )


@pytest.mark.parametrize("name", ["hello", "welcome", "measurement", "command"])
def test_every_flipped_bit_and_every_other_length_is_refused(name) -> None:
    data = vectors()[name]
    key = vectors()["session key"] if name in ("measurement", "command") else KEY
    assert reason(data, key) == ""
    for place in range(8 * len(data)):
        broken = bytearray(data)
        broken[place // 8] ^= 1 << place % 8
        assert reason(bytes(broken), key), f"bit {place}"
    for length in range(len(data)):
        assert reason(data[:length], key) in ("size", "magic")
    assert reason(data + b"\x00", key) == "size"
    assert reason(data * 10, key) == "size"


def test_forged_tag_other_version_other_kind_and_bad_content_are_distinguished() -> None:
    data = wire.command(KEY, WORKED_COMMAND)
    assert reason(wire.command(b"another key entirely", WORKED_COMMAND)) == "tag"
    assert reason(b"\x00" + data[1:]) == "magic"
    assert reason(data[:4] + b"\x02" + data[5:]) == "version"
    assert reason(data[:5] + b"\x09" + data[6:]) == "kind"
    assert reason(wire.command(KEY, WORKED_COMMAND._replace(mode=4))) == "content"


def test_random_datagrams_are_refused_without_any_other_error() -> None:
    generator = random.Random(11)
    good = list(vectors().values())
    for _ in range(FUZZED):
        data = bytearray(generator.choice(good) if generator.random() < 0.7 else generator.randbytes(64))
        for _ in range(generator.randrange(1, 6)):
            data[generator.randrange(len(data))] = generator.randrange(256)
        sent = bytes(data[: generator.randrange(600)])
        assert sent in good or reason(sent) in wire.REASONS


def test_sequence_is_taken_once_and_within_the_window() -> None:
    window = ReplayWindow()
    order = list(range(1, 301))
    generator = random.Random(3)
    for place in range(0, 300, 20):
        part = order[place : place + 20]
        generator.shuffle(part)
        assert all(window.accept(sequence) for sequence in part)
    assert not any(window.accept(sequence) for sequence in range(-5, 301))
    assert (
        window.accept(2**63) and not window.accept(301) and not window.accept(2**63 - 64) and window.accept(2**63 - 63)
    )


def test_key_file_that_others_may_read_is_refused(tmp_path) -> None:
    path = tmp_path / "table.key"
    write_key(path)
    assert path.stat().st_mode & 0o777 == 0o600
    assert len(read_key(path)) == 32
    path.chmod(0o640)
    with pytest.raises(ShakeError, match=r"table.key: mode 640 lets others read the key"):
        read_key(path)
    with pytest.raises(ShakeError, match="cannot be written"):
        write_key(path)


@pytest.mark.parametrize(
    ("content", "why"), [("zz", "hexadecimal"), ("00ff", "2 bytes are not a key"), ("", "0 bytes")]
)
def test_key_that_is_none_is_refused(tmp_path, content, why) -> None:
    path = tmp_path / "key"
    path.touch(0o600)
    path.write_text(content)
    with pytest.raises(ShakeError, match=why):
        read_key(path)


def test_without_a_key_only_this_machine_is_spoken_to() -> None:
    assert key_for("", "127.0.0.1", "localhost") == b""
    for address in ("192.168.10.2", "0.0.0.0"):
        with pytest.raises(ShakeError, match="beyond this machine only with a key file"):
            key_for("", "127.0.0.1", address)


def test_page_shows_the_worked_datagrams_that_the_command_prints() -> None:
    page = re.sub(r"\s", "", PAGE.read_text(encoding="utf-8"))
    for name, data in vectors().items():
        assert data.hex() in page, name


def test_c_listing_of_the_page_has_the_sizes_of_the_datagrams(tmp_path) -> None:
    listing = re.findall(r"```c\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0]
    checks = "".join(
        f'_Static_assert(sizeof(struct {name}) == {wire.SIZES[kind]}, "{name}");\n'
        for name, kind in {"hello": 1, "welcome": 2, "measurement": 3, "command": 4}.items()
    )
    source = tmp_path / "layout.c"
    source.write_text(listing + checks)
    try:
        done = subprocess.run(["cc", "-fsyntax-only", str(source)], capture_output=True, text=True, check=False)
    except FileNotFoundError:
        pytest.skip("needs a C compiler `cc`, which is not here")
    assert done.returncode == 0, done.stderr
