"""The manual: Sphinx with MyST. `./shake docs` builds it into out/docs; a warning is an error."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

import shake_ros

project = "shake_ros"
author = "shake_ros authors"
copyright = "shake_ros authors, MIT licence"
version = release = shake_ros.__version__

subprocess.run(
    [sys.executable, str(HERE / "generators"), str(HERE / "reference" / "generated"), "--figures"], check=True
)

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode", "sphinx_copybutton"]
myst_enable_extensions = ["colon_fence", "dollarmath", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_output_stderr = "remove"
exclude_patterns = ["_build", "generators"]
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
napoleon_google_docstring = False
highlight_language = "none"  # a block that names no language is a program's output
pygments_style, pygments_dark_style = "friendly", "monokai"
napoleon_use_ivar = True
suppress_warnings = ["ref.python"]  # a word of a docstring that two classes have as an attribute

html_theme = "furo"
html_title = f"shake_ros {version}"
html_static_path = ["_static"]
html_css_files = ["manual.css"]
html_show_sphinx = False
html_copy_source = False
