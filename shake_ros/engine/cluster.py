"""The engine of other machines: a running Dask scheduler, by its address. Needs `pip install 'shake_ros[cluster]'`."""

from __future__ import annotations

import ipaddress
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from shake_ros.core.quantities import ShakeError, shown

if TYPE_CHECKING:
    from distributed import Client

WAIT = 20.0  # for the scheduler's answer [s]


def check_address(address: str) -> None:
    """Refuse what is not `tls://HOST:PORT`, or `tcp://HOST:PORT` on this machine.

    >>> check_address("tcp://10.0.0.5:8786")
    Traceback (most recent call last):
        ...
    shake_ros.core.quantities.ShakeError: tcp://10.0.0.5:8786: not encrypted and not on this machine; use tls://
    """
    try:
        parts = urlsplit(address)
        complete = bool(parts.scheme in ("tls", "tcp") and parts.hostname and parts.port and not parts.path)
    except ValueError:
        complete = False
    if not complete:
        raise ShakeError(f"engine {shown(address)}: is neither tls://HOST:PORT nor tcp://HOST:PORT on this machine")
    if parts.scheme == "tcp" and not is_loopback(parts.hostname or ""):
        raise ShakeError(f"{address}: not encrypted and not on this machine; use tls://")


def is_loopback(host: str) -> bool:
    """Whether a host is this machine, by a name or number that no other can have.

    >>> is_loopback("127.0.0.1"), is_loopback("::1"), is_loopback("localhost"), is_loopback("localhost.example.org")
    (True, True, True, False)
    """
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def connect(address: str) -> Client:
    """A client of the scheduler, whose workers are encrypted too, or on this machine.

    The certificates of tls:// are those of Dask's own configuration (`distributed.comm.tls`).

    Raises
    ------
    ShakeError : the address is refused, Dask is not installed, certificates are missing, nobody answers.
    """
    check_address(address)
    try:
        from distributed import Client, Security
    except ModuleNotFoundError as error:
        if error.name not in ("distributed", "dask"):
            raise
        raise ShakeError(
            "--engine needs the Python package 'distributed', which is not installed: pip install 'shake_ros[cluster]'"
        ) from None
    try:
        security = Security(require_encryption=True) if address.startswith("tls:") else None
        client = Client(address, security=security, timeout=WAIT, set_as_default=False)
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        reason = next((line for line in str(error).splitlines() if line.strip()), type(error).__name__)
        raise ShakeError(f"engine {address}: no connection ({reason})") from None
    refused = [worker for worker in client.nthreads() if not _private(worker)]
    if refused:
        client.close()
        raise ShakeError(f"engine {address}: its worker {refused[0]} is not encrypted and not on this machine")
    return client


def threads(client: Any) -> int:
    """Tasks that the cluster's workers take at a time, now; at least one, as workers may still come."""
    return max(sum(client.nthreads().values()), 1)


def _private(worker: str) -> bool:
    parts = urlsplit(worker)
    return parts.scheme in ("tls", "inproc") or is_loopback(parts.hostname or "")
