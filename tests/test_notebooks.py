"""The notebooks of the documentation run from top to bottom, and show their pictures."""

from __future__ import annotations

from pathlib import Path

import nbclient
import pytest
from myst_nb.core.read import read_myst_markdown_notebook

NOTEBOOKS = Path(__file__).parents[1] / "docs" / "notebooks"
PICTURES = {"gallery": 8, "own_data": 3, "real_damper": 3}
PUBLIC_DATA = ("real_damper",)  # of which a notebook is made


@pytest.mark.nightly  # `make docs` runs them, too
@pytest.mark.parametrize("name", sorted(path.stem for path in NOTEBOOKS.glob("*.md")))
def test_a_notebook_runs_and_shows_its_pictures(name, tmp_path, request):
    if name in PUBLIC_DATA:
        request.getfixturevalue("real_data")
    text = (NOTEBOOKS / f"{name}.md").read_text(encoding="utf-8")
    notebook = read_myst_markdown_notebook(text)
    nbclient.NotebookClient(
        notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    shown = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    assert not [each for each in shown if each.output_type == "error"]
    kinds = ("text/html", "image/svg+xml")
    pictures = [each for each in shown if any("<svg" in each.get("data", {}).get(kind, "") for kind in kinds)]
    assert len(pictures) >= PICTURES[name]
