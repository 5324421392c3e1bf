"""Effects that a declared model may lack, one file for each part of the table, and the literal table of all of them.

To add one: write its class (parameters with neutral defaults, place) and its kernels in the file of its part, add its
row here, call its kernel in the right-hand side (plant/right_hand_side.py) or in the sensors (plant/sensors.py), give
its trial values in config/discovery/effects.yaml. The tests over this table do the rest.
"""

from __future__ import annotations

from shake_ros.physics.effects import friction, hydraulics, sensors, structure, unlisted, valve
from shake_ros.physics.effects.effect import PLACES, Effect

EFFECTS: dict[str, type[Effect]] = {
    "spool_deadband": valve.SpoolDeadband,
    "spool_hysteresis": valve.SpoolHysteresis,
    "asymmetric_flow_gain": valve.AsymmetricFlowGain,
    "valve_null_shift": valve.ValveNullShift,
    "slow_valve": valve.SlowValve,
    "turbulent_leakage": hydraulics.TurbulentLeakage,
    "supply_droop": hydraulics.SupplyDroop,
    "tank_back_pressure": hydraulics.TankBackPressure,
    "pressure_dependent_bulk_modulus": hydraulics.PressureDependentBulkModulus,
    "entrained_air": hydraulics.EntrainedAir,
    "soft_zone": hydraulics.SoftZone,
    "dead_volume": hydraulics.DeadVolume,
    "oil_warming": hydraulics.OilWarming,
    "friction_asymmetry": friction.FrictionAsymmetry,
    "position_dependent_friction": friction.PositionDependentFriction,
    "presliding_friction": friction.PreslidingFriction,
    "film_friction": friction.FilmFriction,
    "quadratic_drag": friction.QuadraticDrag,
    "coulomb_friction": friction.CoulombFriction,
    "constant_force": structure.ConstantForce,
    "stiffness_to_ground": structure.StiffnessToGround,
    "specimen_resonance": structure.SpecimenResonance,
    "coupling_backlash": structure.CouplingBacklash,
    "base_flexibility": structure.BaseFlexibility,
    "payload_error": structure.PayloadError,
    "accelerometer_scale": sensors.AccelerometerScale,
    "accelerometer_bias": sensors.AccelerometerBias,
    "accelerometer_lag": sensors.AccelerometerLag,
    "position_sensor_lag": sensors.PositionSensorLag,
    "command_delay": valve.CommandDelay,
    "unlisted": unlisted.Unlisted,
}

__all__ = ["EFFECTS", "PLACES", "Effect"]
