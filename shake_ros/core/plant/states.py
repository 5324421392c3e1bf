"""State vector of the table: indices, units, and which states a set of parameters sets in motion.

The six states of (6.2) come first; those of effects follow and are integrated only where an effect needs them.
Behind the continuous states stand three that change once a step: the spool command behind the play, and the
start values of the pre-sliding law.
"""

from __future__ import annotations

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
CONTINUOUS = 16  # number of continuous states
HELD_COMMAND = 16  # spool command behind the play [-]
BRISTLE = 17  # relative pre-sliding deflection s at the step's start [-]
STEP_SIZE = 18  # last accepted step of the integrator [s]
STATES = 19
