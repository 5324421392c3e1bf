"""`reproduce`: the experiments of the thesis's chapter 6 run again, each claim beside what is found here."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shake_ros.api.experiments import EXPERIMENTS
from shake_ros.api.progress import Progress, Told
from shake_ros.api.result_table import ResultTable
from shake_ros.core.quantities import unknown_name
from shake_ros.data.results import write_folder, write_json
from shake_ros.settings import find, read_yaml

if TYPE_CHECKING:
    from shake_ros.report.experiment import ExperimentReport

ALL = "all"


@dataclass(frozen=True, repr=False)
class Reproduction:
    """Experiments of the thesis by name, each with its claims, tables and figures."""

    experiments: Mapping[str, ExperimentReport]

    @property
    def claims(self) -> ResultTable:
        """Every claim: experiment, section, statement, what is printed, what is found, verdict."""
        rows = [(name, *c[:4], c.verdict) for name, e in self.experiments.items() for c in e.claims]
        return ResultTable(("experiment", "section", "statement", "printed", "found", "verdict"), rows)

    def report(self, out: str | Path, force: bool = False, *, figures: str | None = None, command: str = "") -> None:
        """Write index.html, a page for each experiment, claims.txt, claims.json, tables.txt; as Discovery.report."""
        write_folder(Path(out), lambda folder: self._fill(folder, figures, command), force=force)

    def _fill(self, folder: Path, figures: str | None, command: str) -> None:
        from shake_ros.report.reproduction_page import experiment_page, index_page, tables_text
        from shake_ros.report.written import write_page

        write_page(index_page(self.experiments, command, figure_list()), folder, name="index")
        for name, experiment in self.experiments.items():
            write_page(experiment_page(experiment, command), folder, figures, name)
        (folder / "claims.txt").write_text(f"{self!r}\n", encoding="utf-8")
        (folder / "tables.txt").write_text(tables_text(self.experiments), encoding="utf-8")
        content = {name: [c._asdict() for c in e.claims] for name, e in self.experiments.items()}
        write_json(folder / "claims.json", {"schema": "shake_ros.reproduce/1", "claims": content})

    def __repr__(self) -> str:
        from shake_ros.report.reproduction_page import claims_text

        return claims_text(self.experiments)


def figure_list() -> dict[str, str]:
    """Figures of chapter 6 by number, or numbers from to, and what draws them or why nothing does."""
    content: dict[str, str] = read_yaml(find("reproduce", "figures"))
    return content


def known_experiments(names: Sequence[str]) -> list[str]:
    """The names once each, all of them for none or "all"; raises UnknownName."""
    for name in names:
        if name not in (*EXPERIMENTS, ALL):
            raise unknown_name("experiment", name, [*EXPERIMENTS, ALL])
    return list(EXPERIMENTS) if ALL in names or not names else list(dict.fromkeys(names))


def reproduce(*names: str, progress: Told = True) -> Reproduction:
    """Run experiments of the thesis's chapter 6 again; minutes for all of them.

    Parameters
    ----------
    names : of experiments; none or "all" stands for every one. progress : whether it is shown, or who is told.

    Raises
    ------
    UnknownName
        With the experiments there are.

    Examples
    --------
    >>> import shake_ros as sr
    >>> found = sr.reproduce("sensitivity", progress=False)
    >>> found.claims["verdict"][0]
    'does not hold'
    """
    wanted = known_experiments(names)
    found = {}
    with Progress("reproduce", progress) as tell:
        for i, name in enumerate(wanted):
            tell.span(i / len(wanted), (i + 1) / len(wanted))
            tell(EXPERIMENTS[name].line, 0.0)
            module, function = EXPERIMENTS[name].run_by.split(":")
            found[name] = getattr(importlib.import_module(module), function)(tell)
    return Reproduction(found)
