"""What `close_loop` shows of the table that a controller would track better with: the loop before and after."""

from __future__ import annotations

from dataclasses import dataclass

from shake_ros.api.tune_table import TunedTable, load_robust
from shake_ros.core.control import CONTROLLERS
from shake_ros.core.control.runner import Controller
from shake_ros.core.discovery.close_loop import LoopClosure
from shake_ros.core.loop.robust import Uncertainty, neighbours, uncertainty_of
from shake_ros.core.loop.trials import TrackingBenefit, benefit
from shake_ros.core.observer import OBSERVERS
from shake_ros.core.observer.runner import Observer
from shake_ros.core.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.core.quantities import Parameters, choice, quantity
from shake_ros.data.reference_file import build_program
from shake_ros.settings import find, load_variant, read_yaml


@dataclass(frozen=True)
class TrackingSettings(Parameters):
    """Content of config/identification/tracking.yaml."""

    observer: str = choice("observer, a name of config/observer")
    controller: str = choice("controller, a name of config/controller")
    reference: str = choice("reference, a name of config/reference")
    sample_time: float = quantity("s", "sample time of the loop", low=1e-5, high=0.1)
    delay: int = quantity("-", "samples by which a command reaches the valve late", low=0, high=100)


def tracking(
    result: LoopClosure, known: Uncertainty | None = None, tuned: TunedTable | None = None
) -> TrackingBenefit | None:
    """The identified table under the declared model and under the final one; None where nothing was added.

    None also for declared models that have no valve to control.

    Parameters
    ----------
    known : of the final table's parameters; the loop is looked at on neighbours within it as well.
    tuned : observer and gains made for the final table, which run beside.
    """
    table, declared = result.final.table, result.baseline.table
    if result.model.layout is not FULL_LAYOUT or not (result.search.steps or tuned):
        return None
    path = find("identification", "tracking")
    settings = TrackingSettings.from_mapping(read_yaml(path), str(path))

    def loops(model: TableParameters) -> tuple[Observer, Controller]:
        observer = Observer(*load_variant("observer", settings.observer, OBSERVERS), settings.sample_time, model)
        law = Controller(*load_variant("controller", settings.controller, CONTROLLERS), settings.sample_time, model)
        return observer, law

    program = build_program(settings.reference, settings.sample_time)
    content, s = load_robust("default")
    around = neighbours(table, known or uncertainty_of(table, s), content["loads"], s)
    return benefit(
        table,
        declared,
        table,
        loops,
        program.samples(0, program.length),
        settings.reference,
        delay=settings.delay,
        tuned=(tuned.loop(settings.sample_time), tuned.margins) if tuned else None,
        neighbours=around,
    )
