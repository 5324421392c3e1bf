"""Every script and notebook of examples/ runs, in the order in which later ones use what earlier ones have made."""

from __future__ import annotations

import json
import runpy
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
RECORDINGS = "make_recordings"  # which the later ones read
QUICK = ("simulate_sine", "harmonics", "choose_a_law", "earthquake", RECORDINGS, "identify_table")
SEARCHES = ("close_the_loop", "track_better")  # a long one, and what needs its result
NOTEBOOKS = ("what_an_effect_does", "hide_and_find")
SAYS = {  # what a script must print, beside ending well
    "simulate_sine": "stroke",
    "harmonics": "soft zone of depth 0.84: THD",
    "identify_table": "valve.flow_coefficient",
    "close_the_loop": "spool_deadband",
    "track_better": "repaired table as the model",
    "hide_and_find": "hidden 0.02, found 0.0",
}


@pytest.fixture
def run(bench: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[[Path], str]:
    """Runs a Python file in the folder; returns what it printed."""
    monkeypatch.chdir(bench)
    monkeypatch.syspath_prepend(EXAMPLES)

    def ran(path: Path) -> str:
        with warnings.catch_warnings():
            warnings.filterwarnings("error", category=DeprecationWarning, module="shake_ros")
            runpy.run_path(str(path), run_name="__main__")
        return capsys.readouterr().out

    return ran


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which all of them run."""
    return tmp_path_factory.mktemp("examples")


def test_every_example_is_listed_here_and_short() -> None:
    scripts = {path.stem for path in EXAMPLES.glob("*.py")}
    assert scripts == {*QUICK, *SEARCHES, "laboratory"}
    assert {path.stem for path in EXAMPLES.glob("*.ipynb")} == set(NOTEBOOKS)
    for path in EXAMPLES.glob("*.py"):
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 40, path.name


@pytest.mark.parametrize("name", QUICK)
def test_script_runs(name: str, run: Callable[[Path], str]) -> None:
    assert SAYS.get(name, "") in run(EXAMPLES / f"{name}.py")


@pytest.mark.second_tier
def test_loop_is_closed_with_new_recordings_and_what_it_found_tracks_better(
    bench: Path, run: Callable[[Path], str]
) -> None:
    if not (bench / "run1").exists():  # the second tier alone
        run(EXAMPLES / f"{RECORDINGS}.py")
    for name in SEARCHES:
        assert SAYS[name] in run(EXAMPLES / f"{name}.py")


def code_of(name: str) -> list[str]:
    """The cells of a notebook."""
    cells = json.loads((EXAMPLES / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_notebook_is_short_and_compiles(name: str) -> None:
    assert sum(len(part.splitlines()) for part in code_of(name)) <= 40
    compile("\n\n".join(code_of(name)), name, "exec")


@pytest.mark.second_tier  # `./shake docs` runs them for the manual
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_notebook_runs(name: str, bench: Path, run: Callable[[Path], str]) -> None:
    program = bench / f"{name}.py"
    program.write_text("\n\n".join(code_of(name)), encoding="utf-8")
    assert SAYS.get(name, "") in run(program)


def test_script_of_five_lines_is_the_one_of_the_readme() -> None:
    def statements(text: str) -> list[str]:
        lines = [line.split("#")[0].strip() for line in text.splitlines()]
        return [line for line in lines if line.startswith(("import", "runs", "model", "found"))]

    readme = (EXAMPLES.parent / "README.md").read_text(encoding="utf-8")
    block = readme.split("```python\n")[1].split("```")[0]
    script = (EXAMPLES / "close_the_loop.py").read_text(encoding="utf-8")
    assert statements(script) == [line.replace("my_table.yaml", "bergamo") for line in statements(block)]
