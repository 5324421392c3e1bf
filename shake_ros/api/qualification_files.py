"""Required spectra, rules and settings of a qualification from config/, and the files that it leaves."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shake_ros.api.own_loop import OWN
from shake_ros.core.qualification.judge import Rules, SpectrumJudgement
from shake_ros.core.qualification.motion import MotionParameters
from shake_ros.core.qualification.required import FORMULAS, POINTS, RequiredSpectrum, from_points
from shake_ros.core.qualification.run import RunParameters
from shake_ros.core.qualification.search_motion import SearchParameters
from shake_ros.core.quantities import Parameters, ShakeError, choice, member_from, quantity, strict_keys
from shake_ros.settings import find, read_yaml

SPECTRA, RULES = "required_spectra", "qualification_rules"


@dataclass(frozen=True)
class QualificationLoop(Parameters):
    """The loop under which a test runs."""

    controller: str = choice("a name of config/controller, or own")
    observer: str = choice("a name of config/observer, or own")
    sample_time: float = quantity("s", "of the loop", low=1e-4, high=0.02)

    @property
    def is_own(self) -> bool:
        """Whether observer and controller are made for the model; ShakeError where one of them alone is."""
        if (self.controller == OWN) is not (self.observer == OWN):
            raise ShakeError(f"loop: controller {self.controller}, observer {self.observer}: own goes for both or none")
        return self.controller == OWN


@dataclass(frozen=True)
class QualificationSettings:
    """Content of config/qualification."""

    motion: Mapping[str, Any]
    running: RunParameters
    loop: QualificationLoop
    search: SearchParameters

    def motion_for(self, rules: Rules) -> MotionParameters:
        """How a motion is made for these rules."""
        return MotionParameters.from_mapping({**self.motion, "aim": rules.aim, "aim_last": rules.aim_last}, "motion")


def load_settings(name: str) -> QualificationSettings:
    """config/qualification/<name>.yaml, or a YAML file."""
    path = find("qualification", name)
    keys = ("motion", "running", "loop", "search")
    content = strict_keys(read_yaml(path), keys, str(path), keys, kind="key")
    return QualificationSettings(
        dict(content["motion"]),
        RunParameters.from_mapping(content["running"], f"{path}: running"),
        QualificationLoop.from_mapping(content["loop"], f"{path}: loop"),
        SearchParameters.from_mapping(content["search"], f"{path}: search"),
    )


def load_rules(name: str) -> Rules:
    """config/qualification_rules/<name>.yaml, or a YAML file."""
    path = find(RULES, name)
    return Rules.from_mapping(read_yaml(path), str(path))


def load_required(name: str) -> tuple[RequiredSpectrum, str]:
    """A required spectrum of config/required_spectra, or of a YAML file, and the name of its rules."""
    path = find(SPECTRA, name)
    return required_from(read_yaml(path), str(path))


def required_from(content: Any, where: str) -> tuple[RequiredSpectrum, str]:
    """A required spectrum from a mapping, and the name of its rules."""
    if not isinstance(content, Mapping) or "rules" not in content:
        raise ShakeError(f"{where}: missing key 'rules' (a name of config/{RULES} or a YAML file)")
    rest = {key: value for key, value in content.items() if key != "rules"}
    rules = str(content["rules"])
    if rest.get("kind") == "points":
        return from_points(strict_keys(rest, POINTS, where, POINTS, kind="key"), where), rules
    if rest.get("kind") not in FORMULAS:
        known = ", ".join(sorted((*FORMULAS, "points")))
        raise ShakeError(f"{where}: kind '{rest.get('kind')}' is not known; known: {known}")
    _, formula = member_from(rest, FORMULAS, where, kind="required spectrum")  # type: ignore[type-var]
    return formula.required(), rules


def required_json(required: RequiredSpectrum) -> dict[str, Any]:
    """A required spectrum as points, which `required_of` reads."""
    return {
        "name": required.name,
        "frequencies": required.frequencies.tolist(),
        "levels": required.levels.tolist(),
        "damping": required.damping,
        "zero_period": required.zero_period,
        "source": required.source,
    }


def judgement_json(judgement: SpectrumJudgement) -> dict[str, Any]:
    """Verdicts and spectra of a run."""
    return {
        "passed": judgement.passed,
        "rules": [
            {"rule": v.rule, "asked": v.asked, "measured": v.measured, "passed": v.passed} for v in judgement.verdicts
        ],
        "frequencies": judgement.frequencies.tolist(),
        "required": judgement.required.tolist(),
        "found": judgement.found.tolist(),
    }


def checksums(folder: Path) -> dict[str, str]:
    """SHA-256 of each file below a folder, by its path from there."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
