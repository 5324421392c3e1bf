"""Effects that a declared model may lack: one file each, and the literal table of all of them.

To add one: write its file (parameters with neutral defaults, place, kernel), add its row here, call its kernel in the
right-hand side (plant/right_hand_side.py) or in the sensors (plant/sensors.py), give its trial values in
config/discovery/effects.yaml. The tests over this table do the rest.
"""

from __future__ import annotations

from shake_ros.core.effects.accelerometer_bias import AccelerometerBias
from shake_ros.core.effects.accelerometer_lag import AccelerometerLag
from shake_ros.core.effects.accelerometer_scale import AccelerometerScale
from shake_ros.core.effects.asymmetric_flow_gain import AsymmetricFlowGain
from shake_ros.core.effects.base_flexibility import BaseFlexibility
from shake_ros.core.effects.command_delay import CommandDelay
from shake_ros.core.effects.constant_force import ConstantForce
from shake_ros.core.effects.coulomb_friction import CoulombFriction
from shake_ros.core.effects.coupling_backlash import CouplingBacklash
from shake_ros.core.effects.dead_volume import DeadVolume
from shake_ros.core.effects.effect import PLACES, Effect
from shake_ros.core.effects.entrained_air import EntrainedAir
from shake_ros.core.effects.film_friction import FilmFriction
from shake_ros.core.effects.friction_asymmetry import FrictionAsymmetry
from shake_ros.core.effects.oil_warming import OilWarming
from shake_ros.core.effects.payload_error import PayloadError
from shake_ros.core.effects.position_dependent_friction import PositionDependentFriction
from shake_ros.core.effects.position_sensor_lag import PositionSensorLag
from shake_ros.core.effects.presliding_friction import PreslidingFriction
from shake_ros.core.effects.pressure_dependent_bulk_modulus import PressureDependentBulkModulus
from shake_ros.core.effects.quadratic_drag import QuadraticDrag
from shake_ros.core.effects.slow_valve import SlowValve
from shake_ros.core.effects.soft_zone import SoftZone
from shake_ros.core.effects.specimen_resonance import SpecimenResonance
from shake_ros.core.effects.spool_deadband import SpoolDeadband
from shake_ros.core.effects.spool_hysteresis import SpoolHysteresis
from shake_ros.core.effects.stiffness_to_ground import StiffnessToGround
from shake_ros.core.effects.supply_droop import SupplyDroop
from shake_ros.core.effects.tank_back_pressure import TankBackPressure
from shake_ros.core.effects.turbulent_leakage import TurbulentLeakage
from shake_ros.core.effects.unlisted import Unlisted
from shake_ros.core.effects.valve_null_shift import ValveNullShift

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
