"""An error behind the first fit costs what its step would have added, and nothing that has been found."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from closed_loops import LEAN, bag

from shake_ros import __main__
from shake_ros.api import close_loop as verb
from shake_ros.declared import effect_candidates, model_structure
from shake_ros.fit.likelihood import Levels
from shake_ros.fit.model import FreeModel
from shake_ros.repair import close_loop as closing
from shake_ros.report.page import Page
from shake_ros.search import loop
from shake_ros.search.candidates import listed
from shake_ros.search.loop import Scored, SetSearch
from shake_ros.settings import load_table

STEPS: list[tuple[ModuleType, str, str]] = [
    (loop, "proposals", "search"),
    (closing, "with_nuisances", "nuisance parameters"),
    (closing, "beside_process_noise", "search beside process noise"),
    (closing, "with_verdicts", "verdicts"),
    (closing, "centred", "final fit"),
    (closing, "passed_through", "errors"),
    (closing, "remaining", "what remains"),
    (closing, "latent_forces", "latent force"),
    (closing, "learnt_function", "closed form"),
    (verb, "tune_table", "tuning"),
    (verb, "tracking", "tracking"),
    (verb, "diagnose", "diagnosis"),
    (verb, "diagnosis_json", "diagnosis.json"),
    (verb, "found_section", "page, what was found"),
    (verb, "model_sections", "page, measured against simulated"),
    (verb, "write_page", "page"),
    (Page, "text", "text"),
]
FIRST = ("search", "verdicts", "final fit", "diagnosis", "page", "text")  # the others are of the second tier
CASES = [pytest.param(*one, id=one[2], marks=[] if one[2] in FIRST else pytest.mark.second_tier) for one in STEPS]


def fail(*_: object, **__: object) -> Any:
    raise ArithmeticError("no more")


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("bags")
    return bag("nothing", 1, folder / "learn", 1.5), bag("nothing", 2, folder / "hold", 1.5)


@pytest.fixture
def closed(
    bags: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Any:
    """A short `close_loop` with no effect to try: exit code, lines of standard error, result folder."""
    monkeypatch.setattr(verb, "search_settings", lambda *_: LEAN)
    monkeypatch.setattr(verb, "recordings_to_make", lambda: ())
    monkeypatch.setattr(
        verb, "model_structure", lambda *given: dataclasses.replace(model_structure(*given), candidates=(), shown=())
    )

    def call(*more: str) -> tuple[int, list[str], Path]:
        out = tmp_path / "out"
        code = __main__.main(["close_loop", "--learn", str(bags[0]), "--hold", str(bags[1]), "--out", str(out), *more])
        said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("shake_ros ")]
        return code, said, out

    return call


@pytest.mark.parametrize(("module", "name", "step"), CASES)
def test_failed_step_is_named_and_the_rest_of_the_report_is_there(
    closed: Any, module: ModuleType, name: str, step: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, name, fail)
    code, said, out = closed(*(["--tune"] if step == "tuning" else []))
    assert code == 1
    (line,) = said
    assert line.startswith(f"shake_ros close_loop: the step '{step}' failed: ArithmeticError: no more (")
    content = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert content["final"]["parameters"]["bulk_modulus.modulus"]["value"] == pytest.approx(9.0e8, rel=0.1)
    assert load_table(str(out / "table.yaml")).value("bulk_modulus.modulus") == pytest.approx(9.0e8, rel=0.1)
    if step != "text":  # that is after the report
        assert [failed["step"] for failed in content["failed"]] == [step]
    assert (out / "diagnosis.json").exists() == (step not in ("diagnosis", "diagnosis.json"))
    assert (out / "report.html").exists() == (step != "page")
    if step not in ("page", "text"):
        assert f"The step &#x27;{step}&#x27; failed" in (out / "report.html").read_text(encoding="utf-8")


def test_number_that_is_none_costs_itself_alone(closed: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verb, "accounts_json", lambda *_: [{"least_over_noise": float("nan")}])
    code, said, out = closed()
    assert code == 1
    assert "numbers of report.json" in said[0]
    content = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert content["remaining"]["predictable"] == [{"least_over_noise": None}]


def test_error_within_the_search_leaves_what_it_had_found(closed: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    (effect,) = (c for c in effect_candidates() if c.effect == "spool_deadband")

    def run(search: SetSearch, model: FreeModel, levels: Levels, *_: object) -> Iterator[Scored]:
        yield search.scored(model, 1, search.data, levels)
        yield search.scored(model.with_effect(listed(effect), effect.trials[0]), 1, search.data, levels)
        raise KeyError("behind the first effect")

    monkeypatch.setattr(SetSearch, "run", run)
    monkeypatch.setattr(
        verb, "model_structure", lambda *given: dataclasses.replace(model_structure(*given), candidates=(effect,))
    )
    monkeypatch.setattr(closing, "with_verdicts", lambda problem, found, _: (found, (), ()))
    monkeypatch.setattr(verb, "tracking", lambda *_: None)
    code, said, out = closed()
    assert code == 1
    assert "the step 'search' failed: KeyError" in said[0]
    content = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert [s["effect"] for s in content["steps"]] == ["spool_deadband"]
    assert content["ended_early"]
    assert "effects" in (out / "table.yaml").read_text(encoding="utf-8")
