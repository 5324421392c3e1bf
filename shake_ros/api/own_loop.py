"""A loop of a table's own: gains that `tune` makes for it, and an observer that takes the accelerometer.

Gains made for another table ring on one with a softer zone, and the acceleration that an observer makes of a position
with 8 µm of noise does not damp such a zone: both showed on the tables bergamo_measured and bergamo_table_6_9
(`python -m benchmarks.qualification.iterate_defaults`).
"""

from __future__ import annotations

from dataclasses import dataclass

from shake_ros.api.tune_table import tune_table
from shake_ros.core.control.law import LawParameters
from shake_ros.core.control.runner import Controller
from shake_ros.core.observer import OBSERVERS
from shake_ros.core.observer.law import ObserverParameters
from shake_ros.core.observer.runner import Observer
from shake_ros.core.plant.parameters import DELAY, TableParameters
from shake_ros.settings import load_variant

OWN = "own"  # in place of the name of a controller or an observer
LAW = "three_variable"  # acts on the error alone, so that what an integral has gathered does not outlast a run
FUSED = "fused_accelerometer"
MODEL_BANDWIDTH = 200.0  # rad/s, of the virtual table: with tune's 100 it misses twice as much of the motion by itself
SAME = ("beta1", "beta2", "beta3", "beta4", "beta5", "position_noise", "jerk_noise", "disturbance_noise", "predict")


@dataclass(frozen=True)
class OwnLoop:
    """Parameters of observer and controller for a table, whatever model they carry.

    Attributes
    ----------
    observer, law : their parameters. kind : of the law. sound : whether it rings on no neighbour of the table.
    """

    observer: ObserverParameters
    kind: str
    law: LawParameters
    sound: bool

    def of(self, model: TableParameters, sample_time: float, late: float) -> tuple[Observer, Controller]:
        """Both with a model; `late` is the loop's dead time [s], which a fitted model with a delay knows by itself."""
        known = {"loop_delay": 0.0 if model.value(DELAY) > 0.0 else late}
        observer = Observer("fused", self.observer.replace(**known), sample_time, model)
        return observer, Controller(self.kind, self.law.replace(**known), sample_time, model)


def own_loop(table: TableParameters) -> OwnLoop:
    """The loop of a table, in some seconds; ShakeError where none can be made."""
    tuned = tune_table(table, laws=[LAW], progress=False)
    parameters: ObserverParameters
    _, parameters = load_variant("observer", FUSED, OBSERVERS)
    observer = parameters.replace(**{name: getattr(tuned.observer, name) for name in SAME})
    law = tuned.best.parameters.replace(model_bandwidth=MODEL_BANDWIDTH)
    return OwnLoop(observer, tuned.best.kind, law, tuned.sound)
