# SPDX-License-Identifier: BSD-3-Clause
"""Rerun in a notebook, with a real kernel."""

import json

import pytest
from recordings import write_survey

pytestmark = pytest.mark.needs("ipykernel", "mcap", "nbclient", "rerun", "rerun_notebook")

MAP = """
from grid_map_core_py import GridMap
from grid_map_visualization_py.rerun import Style, show
show(GridMap((2, 1), 0.1, layers={"elevation": 1.0}), Style(exaggeration=2.0))
"""
BAG = """
show("survey", width=700, height=400)
import rerun_notebook
print(rerun_notebook.ESM_MOD)
"""


def test_notebook_shows_maps_and_bags(tmp_path):
    nbformat, client = map(pytest.importorskip, ("nbformat", "nbclient"))
    write_survey(tmp_path / "survey")
    cells = [nbformat.v4.new_code_cell(source) for source in (MAP, BAG)]
    notebook = nbformat.v4.new_notebook(cells=cells)
    resources = {"metadata": {"path": str(tmp_path)}}
    client.NotebookClient(notebook, timeout=100, resources=resources).execute()
    widgets = notebook.metadata["widgets"]["application/vnd.jupyter.widget-state+json"]["state"]
    viewers = [one["state"] for one in widgets.values() if "_width" in one["state"]]
    assert {one["_width"] for one in viewers} >= {700}
    for cell in notebook.cells:
        assert "application/vnd.jupyter.widget-view+json" in json.dumps(cell.outputs)
    # The viewer comes from the installed package, not from another site.
    assert "http://localhost:" in notebook.cells[1].outputs[-1]["text"]
