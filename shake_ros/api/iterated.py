"""What an iteration leaves for the next run: a drive or a model, with the errors of the runs so far."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.progress import Told
from shake_ros.api.result_table import ResultTable, percent
from shake_ros.api.simulated_table import SimulatedTable
from shake_ros.core.identification.recordings import Record
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.data.reference_file import write_drive
from shake_ros.data.results import write_folder, write_json
from shake_ros.settings import save_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shake_ros.report.chart import Chart

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Iterated:
    """The next run of an iteration.

    Attributes
    ----------
    runs : names of the runs so far. missed : error of their acceleration within the band [-].
    drive : position, velocity, acceleration of the next run, shape (n, 3) [m, m/s, m/s²]; None where the model is
    fitted. sample_time : [s]. factor : by which the drive was scaled to stay within its limits [-].
    model : fitted to the last run, or that of the best run where its drive was corrected on a simulated table.
    simulated : the simulated table, where the runs were made on it. reason : why its runs ended.
    wrong : that the runs diverge or have not converged; empty where nothing is wrong.
    first_model : of the first run's feedforward, where there was one. records : the runs as a fit takes them.
    """

    runs: tuple[str, ...]
    missed: tuple[float, ...]
    sample_time: float
    drive: Array | None = None
    factor: float = 1.0
    model: TableParameters | None = None
    simulated: SimulatedTable | None = None
    reason: str = ""
    wrong: str = ""
    first_model: TableParameters | None = None
    records: tuple[Record, ...] = ()

    def lacking(self, progress: Told = True) -> str:
        """Which effect the model of the runs lacks, in a sentence, as `close_loop` finds it in them."""
        from shake_ros.api.lacking import lacking

        if self.first_model is None:
            return "no model of the table is given, whose gaps could be sought in the runs"
        return lacking(self.first_model, self.records, progress=progress)

    @property
    def best(self) -> int:
        """Index of the run that missed least."""
        return int(np.argmin(self.missed))

    @property
    def error(self) -> ResultTable:
        """Acceleration that each run missed within the band, relative to the wanted one [-]."""
        return ResultTable(("run", "error"), list(zip(self.runs, self.missed, strict=True)), {"error": percent})

    def plot(self) -> Figure:
        """Errors of the runs in their order."""
        from shake_ros.report.static_figure import static_figure

        return static_figure(self._charts()[0])

    def _charts(self) -> list[Chart]:
        from shake_ros.report.iteration_page import error_chart, spectrum_chart

        curves = [("measured, within the band", self.missed, "c0")]
        if self.simulated is None:
            return [error_chart(self.runs, curves)]
        curves.append(("true, all frequencies", tuple(self.simulated.errors), "c1"))
        spectra = spectrum_chart(self.simulated.aim, self.simulated.spectra, self.best)
        return [error_chart(self.runs, curves), spectra]

    def report(self, folder: str | Path, force: bool = False, *, figures: str | None = None, command: str = "") -> Path:
        """Write drive.csv and drive.yaml, or model.yaml; iteration.json; report.html. Options as `Discovery.report`."""
        from shake_ros.report.iteration_page import iteration_page
        from shake_ros.report.written import write_page

        out = Path(folder)

        def fill(work: Path) -> None:
            if self.model is not None:
                save_table(work / "model.yaml", self.model, "The model of the next run, by iterate.")
            if self.drive is not None:
                write_drive(work, out, self.drive, self.sample_time)
            write_json(work / "iteration.json", {"schema": "shake_ros.iterate/1", "error_in_band": list(self.missed)})
            true = tuple(self.simulated.errors) if self.simulated else ()
            page = iteration_page(self.runs, self.missed, self._charts(), true, self.reason, command)
            write_page(page, work, figures)

        write_folder(out, fill, force=force)
        return out
