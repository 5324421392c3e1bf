"""No control: the command is held at zero (and a model feedforward, where one is asked for, passes through)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.compiled import njit
from shake_ros.core.control.law import LawParameters, saturate


@dataclass(frozen=True, kw_only=True)
class Hold(LawParameters):
    """Nothing but the limit."""

    code: ClassVar[int] = 0
    states: ClassVar[int] = 0


@njit
def feedforward(p, reference):  # type: ignore[no-untyped-def]
    """Zero, whatever the reference."""
    return 0.0


@njit
def step(state, p, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample; u = feedforward. Arguments and results as in `feedforward_pi.step`."""
    return state.copy(), saturate(feedforward, p.limit)
