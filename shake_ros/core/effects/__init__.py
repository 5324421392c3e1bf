"""Effects that a declared model may lack, one file for each part of the table, and the literal table of all of them.

To add one: write its class (parameters with neutral defaults, place) and its kernels in the file of its part, add its
row here, call its kernel in the right-hand side (plant/right_hand_side.py) or in the sensors (plant/sensors.py), give
its trial values in config/discovery/effects.yaml. The tests over this table do the rest.
"""

from __future__ import annotations

from shake_ros.core.effects.effect import PLACES, Effect
from shake_ros.core.effects.friction import (
    CoulombFriction,
    FilmFriction,
    FrictionAsymmetry,
    PositionDependentFriction,
    PreslidingFriction,
    QuadraticDrag,
)
from shake_ros.core.effects.hydraulics import (
    DeadVolume,
    EntrainedAir,
    OilWarming,
    PressureDependentBulkModulus,
    SoftZone,
    SupplyDroop,
    TankBackPressure,
    TurbulentLeakage,
)
from shake_ros.core.effects.sensors import AccelerometerBias, AccelerometerLag, AccelerometerScale, PositionSensorLag
from shake_ros.core.effects.structure import (
    BaseFlexibility,
    ConstantForce,
    CouplingBacklash,
    PayloadError,
    SpecimenResonance,
    StiffnessToGround,
)
from shake_ros.core.effects.unlisted import Unlisted
from shake_ros.core.effects.valve import (
    AsymmetricFlowGain,
    CommandDelay,
    SlowValve,
    SpoolDeadband,
    SpoolHysteresis,
    ValveNullShift,
)

EFFECTS: dict[str, type[Effect]] = {
    "spool_deadband": SpoolDeadband,
    "spool_hysteresis": SpoolHysteresis,
    "asymmetric_flow_gain": AsymmetricFlowGain,
    "valve_null_shift": ValveNullShift,
    "slow_valve": SlowValve,
    "turbulent_leakage": TurbulentLeakage,
    "supply_droop": SupplyDroop,
    "tank_back_pressure": TankBackPressure,
    "pressure_dependent_bulk_modulus": PressureDependentBulkModulus,
    "entrained_air": EntrainedAir,
    "soft_zone": SoftZone,
    "dead_volume": DeadVolume,
    "oil_warming": OilWarming,
    "friction_asymmetry": FrictionAsymmetry,
    "position_dependent_friction": PositionDependentFriction,
    "presliding_friction": PreslidingFriction,
    "film_friction": FilmFriction,
    "quadratic_drag": QuadraticDrag,
    "coulomb_friction": CoulombFriction,
    "constant_force": ConstantForce,
    "stiffness_to_ground": StiffnessToGround,
    "specimen_resonance": SpecimenResonance,
    "coupling_backlash": CouplingBacklash,
    "base_flexibility": BaseFlexibility,
    "payload_error": PayloadError,
    "accelerometer_scale": AccelerometerScale,
    "accelerometer_bias": AccelerometerBias,
    "accelerometer_lag": AccelerometerLag,
    "position_sensor_lag": PositionSensorLag,
    "command_delay": CommandDelay,
    "unlisted": Unlisted,
}

__all__ = ["EFFECTS", "PLACES", "Effect"]
