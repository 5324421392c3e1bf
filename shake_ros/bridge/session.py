"""Key, session and replay: who may speak, and each datagram once.

Host and target share a secret key. The host sends a nonce, the target answers with the session's number and a nonce of
its own; both derive the session's key from the two, so nothing that was recorded in one session is worth anything in
the next. A session begins with the first command under its key: a repeated hello ends nothing.
"""

from __future__ import annotations

import hmac
import ipaddress
import os
import secrets
import socket
import stat
from collections import Counter
from pathlib import Path

from shake_ros.bridge import wire
from shake_ros.core.quantities import ShakeError

NO_KEY = b""
SHORTEST_KEY = 16
WINDOW = 64  # sequences behind the newest that may still come, once each
CONTEXT = b"shake_ros session 1"


def read_key(path: Path) -> bytes:
    """The shared key of a file of hexadecimal digits.

    Raises
    ------
    ShakeError : unreadable, readable by others than its owner, not hexadecimal or shorter than 16 bytes.
    """
    try:
        with path.open("rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            content = file.read(4096)
    except OSError as error:
        raise ShakeError(f"{path}: cannot be read ({error.strerror})") from None
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise ShakeError(f"{path}: mode {stat.S_IMODE(mode):03o} lets others use the key; chmod 600 it")
    try:
        key = bytes.fromhex(content.decode("ascii").strip())
    except ValueError:
        raise ShakeError(f"{path}: not a key of hexadecimal digits") from None
    if len(key) < SHORTEST_KEY:
        raise ShakeError(f"{path}: {len(key)} bytes are no key, {SHORTEST_KEY} are needed")
    return key


def write_key(path: Path) -> None:
    """A new random key of 32 bytes in a file that only its owner may read; an existing file is an error."""
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise ShakeError(f"{path}: cannot be written ({error.strerror})") from None
    with os.fdopen(descriptor, "w") as file:
        file.write(secrets.token_hex(32) + "\n")


def key_for(key_file: str, *addresses: str) -> bytes:
    """The key of a file; without a file no key, which is for loopback addresses only.

    Raises
    ------
    ShakeError : an address beyond this machine without a key, or none that can be found.
    """
    if key_file:
        return read_key(Path(key_file).expanduser())
    for address in addresses:
        if not ipaddress.ip_address(numeric(address)).is_loopback:
            raise ShakeError(f"address {address}: beyond this machine only with a key file")
    return NO_KEY


def numeric(address: str) -> str:
    """The IPv4 address of a name; raises ShakeError where there is none."""
    try:
        return socket.gethostbyname(address)
    except (OSError, UnicodeError):
        raise ShakeError(f"address {address!r}: not found") from None


def session_key(key: bytes, host_nonce: bytes, target_nonce: bytes) -> bytes:
    """The key of a session: HMAC-SHA256 of its two nonces."""
    return hmac.digest(key, CONTEXT + host_nonce + target_nonce, "sha256")


class ReplayWindow:
    """Whether a sequence number is new.

    >>> window = ReplayWindow()
    >>> [window.accept(n) for n in (1, 3, 2, 3, 100, 36, 37, 37)]
    [True, True, True, False, True, False, True, False]
    """

    def __init__(self) -> None:
        self.newest = 0
        self._seen = 0  # bit i: newest − i has come

    def accept(self, sequence: int) -> bool:
        """True once for each sequence from 1 on, unless it is WINDOW or more behind the newest."""
        ahead = sequence - self.newest
        if ahead > 0:
            self._seen = ((self._seen << ahead) | 1) & (2**WINDOW - 1) if ahead < WINDOW else 1
            self.newest = sequence
            return True
        if sequence < 1 or -ahead >= WINDOW or self._seen >> -ahead & 1:
            return False
        self._seen |= 1 << -ahead
        return True


class Session:
    """One session as either end keeps it."""

    def __init__(self, number: int, key: bytes) -> None:
        self.number = number
        self.key = key
        self.sent = 0
        self.window = ReplayWindow()

    def next_sequence(self) -> int:
        """Sequence of the next datagram to send, from 1 on."""
        self.sent += 1
        return self.sent


def new_counts() -> Counter[str]:
    """Rejected datagrams by reason."""
    return Counter(dict.fromkeys(wire.REASONS, 0))
