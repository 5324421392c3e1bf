"""The face of the observers: state in, state and estimate out; checks what comes from outside."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.observer import OBSERVERS, linear, sliding_mode
from shake_ros.core.observer.model import ModelFilter, ModelObserver
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.reduced import ReducedParameters
from shake_ros.core.quantities import OutOfBounds, ShakeError, unknown_name

KERNELS: dict[str, Any] = {
    "sliding_mode": sliding_mode,
    "linear": linear,
}


class CompiledFilter:
    """`initial_state` and `step` of an observer that is one compiled kernel with packed parameters."""

    def __init__(self, kernels: Any, parameters: ReducedParameters, sample_time: float) -> None:
        self.initial_state = kernels.initial_state
        self._step, self._packed, self._sample_time = kernels.step, kernels.pack(parameters, sample_time), sample_time

    def step(self, state: NDArray[np.float64], position: float, command: float) -> Any:
        """One sample: (state, estimate)."""
        return self._step(state, self._packed, position, command, self._sample_time)


class Observer:
    """An observer of one kind at one sample time; holds no state of its own.

    Parameters
    ----------
    kind : a name in `OBSERVERS`.
    parameters : of that kind's class.
    sample_time : [s]
    model : the table that the observer `model` carries; needed by that kind alone.

    Raises
    ------
    UnknownName, ShakeError : unknown kind, parameters of another kind, sample time not positive, model missing.
    """

    def __init__(
        self, kind: str, parameters: ReducedParameters, sample_time: float, model: TableParameters | None = None
    ) -> None:
        if kind not in OBSERVERS:
            raise unknown_name("observer", kind, OBSERVERS)
        if not isinstance(parameters, OBSERVERS[kind]):
            raise ShakeError(f"observer '{kind}' cannot use {type(parameters).__name__}")
        if not (math.isfinite(sample_time) and sample_time > 0.0):
            raise OutOfBounds(f"sample_time = {sample_time!r} is not a positive number")
        self.kind = kind
        self.parameters = parameters
        self.sample_time = float(sample_time)
        self._filter: Any
        if isinstance(parameters, ModelObserver):
            self._filter = ModelFilter(parameters, self.sample_time, model)
        else:
            self._filter = CompiledFilter(KERNELS[kind], parameters, self.sample_time)

    def initial_state(self, position: float) -> NDArray[np.float64]:
        """At rest at a position [m]."""
        if not math.isfinite(position):
            raise ShakeError(f"observer: initial position is {position!r}")
        state: NDArray[np.float64] = self._filter.initial_state(float(position))
        return state

    def step(
        self, state: NDArray[np.float64], measured_position: float, u_previous: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """One sample.

        Parameters
        ----------
        state : from `initial_state` or the step before; not changed.
        measured_position : now [m]
        u_previous : command held since the sample before [-]

        Returns
        -------
        (state, estimate) : new arrays; estimate is (3,): position [m], velocity [m/s], acceleration [m/s²] now.

        Raises
        ------
        ShakeError : a measurement or command that is not a finite number.
        """
        if not (math.isfinite(measured_position) and math.isfinite(u_previous)):
            raise ShakeError(f"observer: position {measured_position!r}, command {u_previous!r} not finite")
        following, estimate = self._filter.step(state, float(measured_position), float(u_previous))
        return following, estimate
