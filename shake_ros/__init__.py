"""Servo-hydraulic shaking table: simulation, control and identification as a ROS 2 node graph.

    import shake_ros as sr

The names of FILES are imported when they are first used; none of them needs ROS.
"""

from __future__ import annotations

import importlib
import os
from typing import TYPE_CHECKING, Any

# Fits run side by side on all cores; threads of BLAS beside them only spin. Read by numpy when it is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

__version__ = "1.1.0"

FILES = {  # file → names
    "api.close_loop": "Discovery close_loop",
    "api.compare": "Comparison compare",
    "api.identify": "Identification identify",
    "api.import_csv": "import_csv import_proposal",
    "api.model": "Model model",
    "api.read": "Recordings read recording",
    "api.record_scale": "ScaledRecord accelerogram record_scale",
    "api.response_spectrum": "AccelerationSpectra ResponseSpectrum acceleration_spectra response_spectrum",
    "api.signals": "frequency_response multisine_split thd",
    "api.simulate": "Simulation simulate",
    "api.table": "TableFile table",
    "api.tune": "TunedController tune",
    "api.tune_table": "TunedTable",
    "campaigns.campaign": "Campaign campaign",
    "commissioning.commission": "Commission commission",
    "demonstration.demo": "Demo demo",
    "experiment_design.next_recording": "NextRecording next_recording",
    "iteration.iterate": "Iterated iterate iterate_simulated",
    "iteration.table": "SimulatedTable",
    "measured.runs": "MeasuredComparison measured_runs",
    "qualification.qualify": "qualify",
    "qualification.result": "Qualification certified",
    "qualification.sequence": "qualify_sequence",
    "report.result_table": "ResultTable",
    "signals.frequency_response": "describing_function",
    "thesis.figures": "figures",
    "thesis.reproduce": "Reproduction reproduce",
    "thesis.schedule": "ScheduleComparison schedule",
    "thesis.sensitivity": "sensitivity",
    "twin.follow": "Following follow",
}
PUBLIC = {name: f"shake_ros.{file}" for file, names in FILES.items() for name in names.split()}

if TYPE_CHECKING:  # the same for type checkers and editors
    from shake_ros.api.close_loop import Discovery as Discovery
    from shake_ros.api.close_loop import close_loop as close_loop
    from shake_ros.api.compare import Comparison as Comparison
    from shake_ros.api.compare import compare as compare
    from shake_ros.api.identify import Identification as Identification
    from shake_ros.api.identify import identify as identify
    from shake_ros.api.import_csv import import_csv as import_csv
    from shake_ros.api.import_csv import import_proposal as import_proposal
    from shake_ros.api.model import Model as Model
    from shake_ros.api.model import model as model
    from shake_ros.api.read import Recordings as Recordings
    from shake_ros.api.read import read as read
    from shake_ros.api.read import recording as recording
    from shake_ros.api.record_scale import ScaledRecord as ScaledRecord
    from shake_ros.api.record_scale import accelerogram as accelerogram
    from shake_ros.api.record_scale import record_scale as record_scale
    from shake_ros.api.response_spectrum import AccelerationSpectra as AccelerationSpectra
    from shake_ros.api.response_spectrum import ResponseSpectrum as ResponseSpectrum
    from shake_ros.api.response_spectrum import acceleration_spectra as acceleration_spectra
    from shake_ros.api.response_spectrum import response_spectrum as response_spectrum
    from shake_ros.api.signals import frequency_response as frequency_response
    from shake_ros.api.signals import multisine_split as multisine_split
    from shake_ros.api.signals import thd as thd
    from shake_ros.api.simulate import Simulation as Simulation
    from shake_ros.api.simulate import simulate as simulate
    from shake_ros.api.table import TableFile as TableFile
    from shake_ros.api.table import table as table
    from shake_ros.api.tune import TunedController as TunedController
    from shake_ros.api.tune import tune as tune
    from shake_ros.api.tune_table import TunedTable as TunedTable
    from shake_ros.campaigns.campaign import Campaign as Campaign
    from shake_ros.campaigns.campaign import campaign as campaign
    from shake_ros.commissioning.commission import Commission as Commission
    from shake_ros.commissioning.commission import commission as commission
    from shake_ros.demonstration.demo import Demo as Demo
    from shake_ros.demonstration.demo import demo as demo
    from shake_ros.experiment_design.next_recording import NextRecording as NextRecording
    from shake_ros.experiment_design.next_recording import next_recording as next_recording
    from shake_ros.iteration.iterate import Iterated as Iterated
    from shake_ros.iteration.iterate import iterate as iterate
    from shake_ros.iteration.iterate import iterate_simulated as iterate_simulated
    from shake_ros.iteration.table import SimulatedTable as SimulatedTable
    from shake_ros.measured.runs import MeasuredComparison as MeasuredComparison
    from shake_ros.measured.runs import measured_runs as measured_runs
    from shake_ros.qualification.qualify import qualify as qualify
    from shake_ros.qualification.result import Qualification as Qualification
    from shake_ros.qualification.result import certified as certified
    from shake_ros.qualification.sequence import qualify_sequence as qualify_sequence
    from shake_ros.report.result_table import ResultTable as ResultTable
    from shake_ros.signals.frequency_response import describing_function as describing_function
    from shake_ros.thesis.figures import figures as figures
    from shake_ros.thesis.reproduce import Reproduction as Reproduction
    from shake_ros.thesis.reproduce import reproduce as reproduce
    from shake_ros.thesis.schedule import ScheduleComparison as ScheduleComparison
    from shake_ros.thesis.schedule import schedule as schedule
    from shake_ros.thesis.sensitivity import sensitivity as sensitivity
    from shake_ros.twin.follow import Following as Following
    from shake_ros.twin.follow import follow as follow

__all__ = list(PUBLIC)


def __getattr__(name: str) -> Any:
    if name not in PUBLIC:
        raise AttributeError(f"module 'shake_ros' has no attribute '{name}'")
    return getattr(importlib.import_module(PUBLIC[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *PUBLIC})
