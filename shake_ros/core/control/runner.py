"""The face of the controllers: state in, state and command out; limits, bumpless start, model feedforward."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.control import CONTROLLERS, feedforward_pi, hold, sliding_mode, super_twisting
from shake_ros.core.control.law import LawParameters
from shake_ros.core.control.virtual_table import VirtualTable
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import OutOfBounds, ShakeError, unknown_name

KERNELS: dict[str, Any] = {
    "none": hold,
    "feedforward_pi": feedforward_pi,
    "sliding_mode": sliding_mode,
    "super_twisting": super_twisting,
}
HEAD = 2  # of the state: whether it has started, and the decaying offset of the start


class Controller:
    """A controller of one kind at one sample time; holds no state of its own.

    Parameters
    ----------
    kind : a name in `CONTROLLERS`.
    parameters : of that kind's class.
    sample_time : [s]
    model : table whose virtual copy makes the feedforward; needed where `parameters.model` names one.

    Raises
    ------
    UnknownName, ShakeError : unknown kind, parameters of another kind, sample time not positive, model missing.
    """

    def __init__(
        self, kind: str, parameters: LawParameters, sample_time: float, model: TableParameters | None = None
    ) -> None:
        if kind not in CONTROLLERS:
            raise unknown_name("controller", kind, CONTROLLERS)
        if not isinstance(parameters, CONTROLLERS[kind]):
            raise ShakeError(f"controller '{kind}' cannot use {type(parameters).__name__}")
        if not (math.isfinite(sample_time) and sample_time > 0.0):
            raise OutOfBounds(f"sample_time = {sample_time!r} is not a positive number")
        self.kind = kind
        self.parameters = parameters
        self.sample_time = float(sample_time)
        self._kernels = KERNELS[kind]
        if parameters.model and model is None:
            raise ShakeError(f"controller '{kind}': the table '{parameters.model}' of its model was not handed over")
        self._virtual = None
        if model is not None:
            p = parameters
            self._virtual = VirtualTable(model, self.sample_time, p.model_bandwidth, p.model_horizon, p.limit)
        self._packed = self._kernels.pack(parameters, model is not None)
        self._law = slice(HEAD, HEAD + self._kernels.STATES)
        start_time = parameters.start_time
        self._decay = math.exp(-self.sample_time / start_time) if start_time > 0.0 else 0.0

    def initial_state(self) -> NDArray[np.float64]:
        """Not started, all integrals zero."""
        return np.zeros(self._law.stop + (self._virtual.size if self._virtual else 0))

    def step(self, state: NDArray[np.float64], reference: Any, estimate: Any) -> tuple[NDArray[np.float64], float]:
        """One sample.

        The first sample's command is zero: an offset takes the feedback's first demand away and then decays with
        `start_time`, so that switching on away from the reference makes no bump.

        Parameters
        ----------
        state : from `initial_state` or the step before; not changed.
        reference, estimate : three numbers each, position [m], velocity [m/s], acceleration [m/s²]

        Returns
        -------
        (state, u) : new array; command within ±limit [-]

        Raises
        ------
        ShakeError : a reference or estimate that is not finite.
        """
        r = np.array(reference, dtype=np.float64)
        z = np.array(estimate, dtype=np.float64)
        if r.shape != (3,) or z.shape != (3,):
            raise ShakeError(f"controller: expected three numbers each, got {r.shape} and {z.shape}")
        if not (np.isfinite(r).all() and np.isfinite(z).all()):
            raise ShakeError(f"controller: reference {r.tolist()} or estimate {z.tolist()} not finite")
        following = np.empty_like(state)
        if self._virtual is None:
            command = self._kernels.feedforward(self._packed, r)
        else:
            following[self._law.stop :], command, r = self._virtual.step(state[self._law.stop :], reference)
        offset = state[1] * self._decay
        if state[0] == 0.0 and self._decay > 0.0:
            _, demand = self._kernels.step(state[self._law], self._packed, r, z, command, self.sample_time)
            offset = -demand
        law, u = self._kernels.step(state[self._law], self._packed, r, z, command + offset, self.sample_time)
        following[0] = 1.0
        following[1] = offset
        following[self._law] = law
        return following, float(u)
