"""No control: the command is held at zero (and a model feedforward, where one is asked for, passes through)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.compiled import njit
from shake_ros.core.control.law import LawParameters, saturate

CODE = 0
STATES = 0


@dataclass(frozen=True, kw_only=True)
class Hold(LawParameters):
    """Nothing but the limit."""


def pack(parameters: Hold, model_feedforward: bool) -> NDArray[np.float64]:
    """The limit as an array (1,)."""
    return np.array([parameters.limit])


@njit
def feedforward(parameters, reference):  # type: ignore[no-untyped-def]
    """Zero, whatever the reference."""
    return 0.0


@njit
def step(state, parameters, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample; u = feedforward. Arguments and results as in `feedforward_pi.step`."""
    return state.copy(), saturate(feedforward, parameters[0])
