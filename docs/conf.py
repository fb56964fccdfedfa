"""Sphinx: MyST pages, the API from docstrings, the Furo theme. ``make docs`` builds into build/docs."""

import os
import sys
from importlib.metadata import version as installed
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))

SOURCE = HERE.parent / "src"
for stub in (HERE / "_api").glob("*.rst"):  # Stubs of autosummary for removed modules.
    module = SOURCE.joinpath(*stub.stem.split("."))
    if not (module.is_dir() or module.with_suffix(".py").is_file()):
        stub.unlink()

project = "mrdamper"
project_copyright = "the mrdamper authors"
release = installed("mrdamper")
version = release

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "commands",
    "docstrings",
    "figures",
    "mathml",
]
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "force"  # Notebooks only; tests/test_docs.py runs the other pages.
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 120
# This notebook needs public data. Without them the page has no outputs.
nb_execution_excludepatterns = [] if {"CI", "MRDAMPER_DATA"} & os.environ.keys() else ["*real_damper.md"]
html_theme = "furo"
html_title = f"mrdamper {release}"
html_show_sphinx = False
templates_path = ["_templates"]
autosummary_generate = ["api.md"]
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_type_aliases = {name: name for name in ("ArrayLike", "BoolArray", "FloatArray", "Json")}
napoleon_google_docstring = False
exclude_patterns = ["_build"]
suppress_warnings = [
    "myst.header",
    "misc.highlighting_failure",
    "ref.python",  # Two packages have the same name, so a link of an annotation is ambiguous.
]
