"""What `commission` is told: levels, first loop and limits, from config/commission; the interlock of a level."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.loop.linear_loop import LAWS
from shake_ros.core.quantities import Parameters, ShakeError, quantity, strict_keys, unknown_name
from shake_ros.core.safety.causes import PROGRAM_HOLD, InterlockParameters
from shake_ros.settings import find, read_yaml

KEYS = ("reference", "seconds", "levels", "search_from", "controller", "observer", "interlock", "laws", "numbers")
HELD = ("position_hard", "velocity", "acceleration", "tracking_error")  # limits that grow with the level


@dataclass(frozen=True)
class CommissionNumbers(Parameters):
    """Sample time and the limits of a level."""

    sample_time: float = quantity("s", "sample time", low=1e-5, high=0.1)
    margin: float = quantity("-", "limits over the largest values of the level's motion", low=1.0, high=10.0)
    least_position: float = quantity("m", "added to the limit of the position", low=0.0, high=1.0)
    least_velocity: float = quantity("m/s", "added to the limit of the velocity", low=0.0, high=10.0)
    least_acceleration: float = quantity("m/s^2", "added to the limit of the acceleration", low=0.0, high=1e3)
    distance: float = quantity("m", "from the reference at the first level; grows as the limits do", low=1e-4, high=1.0)


@dataclass(frozen=True)
class CommissionSettings:
    """A file of config/commission.

    `search_from` : level from which `close_loop` seeks what the model lacks, in all runs so far; above 1 it never does.
    """

    reference: str
    seconds: float
    levels: tuple[float, ...]
    search_from: float
    controller: str
    observer: str
    interlock: str
    laws: tuple[str, ...]
    numbers: CommissionNumbers


def load_commission(name: str) -> CommissionSettings:
    """config/commission/<name>.yaml, or a YAML file given by path.

    Raises
    ------
    ShakeError : unknown or missing keys, levels that do not grow to at most 1, an unknown law.
    """
    path = find("commission", name)
    content = dict(strict_keys(read_yaml(path), KEYS, str(path), KEYS, kind="key"))
    try:
        levels, seconds = tuple(float(level) for level in content["levels"]), float(content["seconds"])
        search_from = float(content["search_from"])
    except (TypeError, ValueError):
        raise ShakeError(f"{path}: levels, seconds and search_from: expected numbers") from None
    grows = all(low < high for low, high in zip((0.0, *levels), levels, strict=False))
    if not levels or not grows or levels[-1] > 1.0 or not 1.0 < seconds < 1e4:
        raise ShakeError(f"{path}: levels {list(levels)} must grow from above 0 to at most 1, seconds be above 1")
    for law in content["laws"]:
        if law not in LAWS:
            raise unknown_name("law", law, LAWS, str(path))
    numbers = CommissionNumbers.from_mapping(content["numbers"], f"{path}: numbers")
    own: dict[str, Any] = {"levels": levels, "seconds": seconds, "search_from": search_from, "numbers": numbers}
    own["laws"] = tuple(content["laws"])
    return CommissionSettings(**{**content, **own})


def interlock_of(settings: CommissionSettings, motion: NDArray[np.float64], first: float) -> dict[str, Any]:
    """The interlock of a level as its YAML content: limits around its motion (n, 3), never beyond the outermost ones.

    `first` is the first level over this one. The causes that it holds at ramp the command to zero.
    """
    path, n = find("interlock", settings.interlock), settings.numbers
    content = read_yaml(path)
    outermost = InterlockParameters.from_mapping(content, str(path))
    largest = n.margin * np.max(np.abs(motion), axis=0)
    wanted = (
        largest[0] + n.least_position,
        largest[1] + n.least_velocity,
        largest[2] + n.least_acceleration,
        n.distance / first,
    )
    causes: dict[str, Any] = {name: dict(value) for name, value in content["causes"].items()}
    for name, value in zip(HELD, wanted, strict=True):
        limit = float(min(value, outermost.response(name).threshold))
        causes[name] |= {"threshold": float(f"{limit:.4g}"), "action": PROGRAM_HOLD}
    soft, hard = causes["position_soft"], causes["position_hard"]
    soft["threshold"] = min(soft["threshold"], hard["threshold"])
    return {**content, "causes": causes}


def interlock_parameters(content: Mapping[str, Any]) -> InterlockParameters:
    """The interlock of such a content."""
    return InterlockParameters.from_mapping(content, "interlock of the level")
