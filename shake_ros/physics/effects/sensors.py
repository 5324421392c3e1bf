"""What sensors may add to a measurement: scale, bias and lag."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.physics.effects.effect import Effect
from shake_ros.quantities import quantity


@dataclass(frozen=True)
class AccelerometerScale(Effect):
    """Scale error of the accelerometer.

        a_m → (1 + e) a_m

    Absent at e = 0.
    """

    place: ClassVar[str] = "sensor"
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    error: float = quantity("-", "relative scale error e", low=-0.9, high=9.0, default=0.0)


@dataclass(frozen=True)
class AccelerometerBias(Effect):
    """Zero offset of the accelerometer.

    Or its tilt.

        a_m → a_m + b

    Absent at b = 0.
    """

    place: ClassVar[str] = "sensor"
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    bias: float = quantity("m/s^2", "offset b", low=-50.0, high=50.0, default=0.0)


@dataclass(frozen=True)
class AccelerometerLag(Effect):
    """Low-pass of the accelerometer.

    A low-pass in the accelerometer's conditioner, first order.

        τ ȧ_m = a − a_m

    Absent at τ = 0.
    """

    place: ClassVar[str] = "sensor"
    depends_on: ClassVar[tuple[str, ...]] = ("frequency",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    time_constant: float = quantity("s", "time constant τ", low=0.0, high=0.5, default=0.0)


@dataclass(frozen=True)
class PositionSensorLag(Effect):
    """Low-pass of the position transducer.

    A low-pass in the position transducer's demodulator, first order.

        τ ẋ_m = x − x_m

    Absent at τ = 0.
    """

    place: ClassVar[str] = "sensor"
    depends_on: ClassVar[tuple[str, ...]] = ("frequency",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced", "axis")

    time_constant: float = quantity("s", "time constant τ", low=0.0, high=0.5, default=0.0)
