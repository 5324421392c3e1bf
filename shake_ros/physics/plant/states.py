"""State vector of the table: indices, units, and which states a set of parameters sets in motion.

The six states of (6.2) come first; those of effects follow and are integrated only where an effect needs them.
After the continuous states come those that change once a step: the spool command after the backlash, the contact states
of the friction laws, and the integrator's step.
"""

from __future__ import annotations

LARGEST_STOREYS = 10
POSITION = 0  # x_p, piston relative to the base [m]
VELOCITY = 1  # ẋ_p [m/s]
PRESSURE_A = 2  # P_A [Pa]
PRESSURE_B = 3  # P_B [Pa]
SPOOL = 4  # x_s* [-]
SPOOL_RATE = 5  # ẋ_s* [1/s]
DECLARED = 6  # number of states of the declared model
PRESSURE_SUPPLY = 6  # P_s [Pa]
FILM = 7  # film thickness relative to the full film [-]
SPECIMEN = 8  # displacement of the specimen relative to the table [m]
SPECIMEN_RATE = 9  # [m/s]
ROD = 10  # displacement of the rod relative to the table [m]
ROD_RATE = 11  # [m/s]
BASE = 12  # displacement of the base [m]
BASE_RATE = 13  # [m/s]
LAGGED_ACCELERATION = 14  # accelerometer behind its low-pass [m/s²]
LAGGED_POSITION = 15  # position transducer behind its low-pass [m]
FRICTION_MEMORY = 16  # film thickness [-] or lagged speed [m/s] of the friction law
EXTENDED = 17  # number of states of the declared model with effects
LINE_FLOW_A = 17  # flow through the pipeline into chamber A [m³/s]
LINE_FLOW_B = 18  # flow through the pipeline out of chamber B [m³/s]
LINE_PRESSURE_A = 19  # pressure between valve and pipeline A [Pa]
LINE_PRESSURE_B = 20  # pressure between valve and pipeline B [Pa]
STOREY = 21  # displacement of the first storey relative to the table [m]; its rate, then the next storey's pair
CONTINUOUS = STOREY + 2 * LARGEST_STOREYS  # number of continuous states, the length of work arrays
HELD_COMMAND = CONTINUOUS  # spool command behind the backlash [-]
BRISTLE = CONTINUOUS + 1  # relative pre-sliding deflection s at the step's start [-]
STEP_SIZE = CONTINUOUS + 2  # last accepted step of the integrator [s]
DEFLECTION = CONTINUOUS + 3  # contact state z of a friction law [m]
DWELL = CONTINUOUS + 4  # time that the contact has been stuck [s]
FRICTION_AT_STOP = CONTINUOUS + 5  # Stribeck part of friction when the contact got stuck F_sa [N]
FRICTION_RISE = CONTINUOUS + 6  # Stribeck part of friction now F_s(γ, t_d) [N]
VALVE = CONTINUOUS + 7  # first of the eight states of the detailed valve, see valve/detailed.py
VALVE_TIME = CONTINUOUS + 15  # time within the dither's period [s]
CLOCK = CONTINUOUS + 16  # time since the start of the recording, held over a sample [s]
STATES = CONTINUOUS + 17
