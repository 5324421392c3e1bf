"""What a valve and its command may have beyond the declared model: dead band, hysteresis, gain, null, dead time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.effects.effect import Effect
from shake_ros.quantities import quantity


@dataclass(frozen=True)
class SpoolDeadband(Effect):
    """Dead band of the spool about its null.

    A dead band of the spool: worn or overlapped lands let no flow through until the spool has moved `width`.

        x_e = sign(x_s) max(|x_s| − w, 0)
        d_e = d_s − c min(w, d_s)          for an underlap d_s > 0

    Lands that are wider by more than the underlap close the centre of the valve (c = 1); a dead band of the valve's
    electronics leaves it open (c = 0). Absent at w = 0. Merritt, Hydraulic Control Systems, chapter 5 (overlapped
    spool).
    """

    place: ClassVar[str] = "valve"
    depends_on: ClassVar[tuple[str, ...]] = ("valve_opening",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    width: float = quantity("-", "spool travel without flow on each side of null", low=0.0, high=0.3, default=0.0)
    closed: float = quantity("-", "share of the underlap that it closes", low=0.0, high=1.0, default=1.0)


@njit
def effective_spool(spool, width):
    """Spool position that the ports see [-]."""
    if spool > width:
        return spool - width
    if spool < -width:
        return spool + width
    return 0.0


@njit
def effective_underlap(underlap, width, closed):
    """Underlap of the ports that a dead band leaves [-].

    >>> effective_underlap(0.005, 0.02, 1.0), effective_underlap(0.005, 0.002, 0.5), effective_underlap(-0.01, 0.1, 1.0)
    (0.0, 0.004, -0.01)
    """
    return underlap - closed * min(width, max(underlap, 0.0))


@dataclass(frozen=True)
class SpoolHysteresis(Effect):
    """Hysteresis of the valve beyond the declared one.

    More hysteresis of the valve than its data sheet states: dry friction on the spool or a weak torque motor.

    The half-width adds to the declared f_hs of (3.19) and acts as it does: dry friction on the spool
    (plant/dormand_prince.py), with the detailed valve and the reduced table a backlash of the command. Absent at 0.
    """

    place: ClassVar[str] = "valve"
    depends_on: ClassVar[tuple[str, ...]] = ("valve_opening", "direction")
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    width: float = quantity("-", "additional hysteresis half-width", low=0.0, high=0.3, default=0.0)


@dataclass(frozen=True)
class AsymmetricFlowGain(Effect):
    """Flow gain that differs with the direction of opening.

    Unequal metering edges: the valve passes more one way than the other.

        C_v → C_v (1 + a) for x_s > 0, C_v (1 − a) for x_s < 0

    Absent at a = 0.
    """

    place: ClassVar[str] = "valve"
    depends_on: ClassVar[tuple[str, ...]] = ("direction", "valve_opening")
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    asymmetry: float = quantity("-", "relative excess of flow for positive opening", low=-0.8, high=0.8, default=0.0)


@njit
def flow_factor(spool, asymmetry):
    """Factor on the flow coefficient [-]."""
    return 1.0 + asymmetry if spool > 0.0 else 1.0 - asymmetry


@dataclass(frozen=True)
class ValveNullShift(Effect):
    """Offset between command and hydraulic null.

    The hydraulic null lies off the electrical zero: the table drifts at u = 0.

        x_s follows k_v (u + u_0)

    Absent at u_0 = 0.
    """

    place: ClassVar[str] = "valve"
    depends_on: ClassVar[tuple[str, ...]] = ("valve_opening",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    offset: float = quantity("-", "command that is equivalent to the null shift", low=-0.3, high=0.3, default=0.0)


@dataclass(frozen=True)
class SlowValve(Effect):
    """Spool dynamics slower than declared.

    A valve slower than its catalogue: low pilot pressure, a contaminated filter or a weak amplifier.

        ω_v → ω_v (1 − s)

    and, in the reduced model (6.36), which declares a valve without dynamics, τ ẋ_s = u − x_s. Absent at s = 0, τ =
    0.
    """

    place: ClassVar[str] = "valve"
    depends_on: ClassVar[tuple[str, ...]] = ("frequency",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    slowdown: float = quantity("-", "relative loss of the spool natural frequency", low=-1.0, high=0.97, default=0.0)
    time_constant: float = quantity("s", "lag τ of the valve in the reduced model", low=0.0, high=2.0, default=0.0)


@dataclass(frozen=True)
class CommandDelay(Effect):
    """Dead time between command and valve.

    The command reaches the valve late: network, digital-to-analogue hold, drive electronics.

        u(t) → u(t − T), any fraction of a sample

    Absent at T = 0.
    """

    place: ClassVar[str] = "timing"
    depends_on: ClassVar[tuple[str, ...]] = ("frequency",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced", "axis")

    delay: float = quantity("s", "dead time T", low=0.0, high=0.5, default=0.0)
