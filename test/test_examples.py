"""Every script and notebook of examples/ runs, in the order in which later ones use what earlier ones have made."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
ORDER = (
    *("simulate_sine", "harmonics", "choose_a_law", "earthquake", "make_recordings"),
    *("identify_table", "close_the_loop", "track_better"),
)
NOTEBOOKS = ("what_an_effect_does", "hide_and_find")
SAYS = {  # what a script must print, beside ending well
    "simulate_sine": "stroke",
    "harmonics": "soft zone of depth 0.84: THD",
    "identify_table": "valve.flow_coefficient",
    "close_the_loop": "spool_deadband",
    "track_better": "repaired table as the model",
    "hide_and_find": "hidden 0.02, found 0.0",
}


def run(code: list[str], folder: Path) -> str:
    """Run Python in the folder; what it printed."""
    environment = {**os.environ, "MPLBACKEND": "Agg", "PYTHONPATH": f"{EXAMPLES.parent}{os.pathsep}{EXAMPLES}"}
    environment.pop("PYTHONSAFEPATH", None)
    done = subprocess.run(
        [sys.executable, "-W", "error::DeprecationWarning:shake_ros", *code],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which all of them run."""
    return tmp_path_factory.mktemp("examples")


def test_every_example_is_listed_here_and_short() -> None:
    scripts = {path.stem for path in EXAMPLES.glob("*.py")}
    assert scripts == {*ORDER, "laboratory"}
    assert {path.stem for path in EXAMPLES.glob("*.ipynb")} == set(NOTEBOOKS)
    for path in EXAMPLES.glob("*.py"):
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 40, path.name


@pytest.mark.parametrize("name", ORDER)
def test_script_runs(name: str, bench: Path) -> None:
    assert SAYS.get(name, "") in run([str(EXAMPLES / f"{name}.py")], bench)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_notebook_runs(name: str, bench: Path) -> None:
    cells = json.loads((EXAMPLES / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert sum(len(part.splitlines()) for part in code) <= 40
    program = bench / f"{name}.py"
    program.write_text("\n\n".join(code), encoding="utf-8")
    assert SAYS.get(name, "") in run([str(program)], bench)


def test_script_of_five_lines_is_the_one_of_the_readme() -> None:
    def statements(text: str) -> list[str]:
        lines = [line.split("#")[0].strip() for line in text.splitlines()]
        return [line for line in lines if line.startswith(("import", "runs", "model", "found"))]

    readme = (EXAMPLES.parent / "README.md").read_text(encoding="utf-8")
    block = readme.split("```python\n")[1].split("```")[0]
    script = (EXAMPLES / "close_the_loop.py").read_text(encoding="utf-8")
    assert statements(script) == [line.replace("my_table.yaml", "bergamo") for line in statements(block)]
