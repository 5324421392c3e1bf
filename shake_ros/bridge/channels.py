"""Channels of a target computer: raw value → SI with scale, offset, sign and limits, and the command back."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity, strict_keys

UNITS = {
    "position": "m",
    "acceleration": "m/s^2",
    "pressure_a": "Pa",
    "pressure_b": "Pa",
    "pressure_supply": "Pa",
}


@dataclass(frozen=True)
class IoChannel(Parameters):
    """One measured channel: value = sign · scale · (raw − offset); beyond its limits it is no reading."""

    raw_unit: str = choice("unit of the raw value")
    unit: str = choice("unit of the value")
    present: bool = quantity("", "whether the target has this channel")
    scale: float = quantity("unit/raw_unit", "value for one raw unit", low=1e-12, high=1e12)
    offset: float = quantity("raw_unit", "raw value at zero", low=-1e12, high=1e12)
    sign: int = quantity("-", "1, or -1 where the channel counts the other way", low=-1, high=1)
    lowest: float = quantity("unit", "smallest value that can be", low=-1e12, high=1e12)
    highest: float = quantity("unit", "largest value that can be", low=-1e12, high=1e12)

    def value(self, raw: float) -> float:
        """SI value of a raw one; NaN where it is absent, not finite or beyond the limits.

        >>> channel = IoChannel("V", "m", True, 0.015, 0.1, -1, -0.15, 0.15)
        >>> round(channel.value(2.1), 6), channel.value(12.0)
        (-0.03, nan)
        """
        value = self.sign * self.scale * (raw - self.offset)
        return value if self.present and self.lowest <= value <= self.highest else math.nan


@dataclass(frozen=True)
class Valve(Parameters):
    """The command: raw = sign · scale · u + offset, within ±limit of u."""

    raw_unit: str = choice("unit of the raw value")
    scale: float = quantity("raw_unit", "raw value of the full command", low=1e-12, high=1e12)
    offset: float = quantity("raw_unit", "raw value of the valve's null", low=-1e12, high=1e12)
    sign: int = quantity("-", "1, or -1 where the valve is connected the other way", low=-1, high=1)
    limit: float = quantity("-", "largest command that is ever sent", low=0.0, high=1.0)

    def raw(self, u: float) -> float:
        """Raw value of a command."""
        return self.sign * self.scale * min(max(u, -self.limit), self.limit) + self.offset


@dataclass(frozen=True)
class BridgeParameters(Parameters):
    """Where the target computer is, and its channels."""

    address: str = choice("of the target computer")
    port: int = quantity("-", "UDP port of the target computer", low=1, high=65535)
    local_address: str = choice("of this machine on that network")
    key_file: str = choice("shared key in hexadecimal digits; empty: none, loopback addresses only")
    period: float = quantity("s", "of the target's samples", low=1e-5, high=0.1)
    channels: Any = dataclasses.field(default=None)
    valve: Any = dataclasses.field(default=None)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], where: str) -> BridgeParameters:
        """Build from a YAML mapping; `channels` holds every channel, `valve` the command."""
        if not isinstance(mapping, Mapping) or not isinstance(mapping.get("channels"), Mapping):
            raise ShakeError(f"{where}: expected names, and under 'channels' {', '.join(UNITS)}")
        names = [f.name for f in dataclasses.fields(cls)]
        strict_keys(mapping, names, where, names)
        channels = {}
        for name, content in strict_keys(mapping["channels"], UNITS, where, UNITS, kind="channel").items():
            channel = channels[name] = IoChannel.from_mapping(content, f"{where}: channels.{name}")
            if channel.unit != UNITS[name]:
                raise ShakeError(f"{where}: channels.{name}.unit = '{channel.unit}' must be {UNITS[name]}")
            if channel.sign == 0 or channel.lowest >= channel.highest:
                raise ShakeError(f"{where}: channels.{name}: sign 0, or lowest not below highest")
        valve = Valve.from_mapping(mapping["valve"], f"{where}: valve")
        if valve.sign == 0:
            raise ShakeError(f"{where}: valve.sign = 0")
        rest = {key: value for key, value in mapping.items() if key not in ("channels", "valve")}
        try:
            return cls(**rest, channels=channels, valve=valve)
        except ShakeError as error:
            raise type(error)(f"{where}: {error}") from None
