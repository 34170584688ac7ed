# SPDX-License-Identifier: BSD-3-Clause
"""The notebook of the documentation, run by a kernel."""

import base64
from pathlib import Path
from typing import Any

import cv2
import matplotlib
import numpy as np
import pytest

NOTEBOOK = Path(__file__).parents[2] / "docs" / "notebooks" / "pictures.ipynb"


@pytest.fixture(scope="module")
def outputs() -> dict[str, dict[str, Any]]:
    """Return the data that each cell of code shows, by its source."""
    nbformat = pytest.importorskip("nbformat")
    client = pytest.importorskip("nbclient")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells)
    with pytest.MonkeyPatch.context() as patch:
        # The kernel sets its own.
        patch.delenv("MPLBACKEND", raising=False)
        client.NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    shown = {cell.source: cell.outputs for cell in notebook.cells if cell.cell_type == "code"}
    assert all(len(found) <= 1 for found in shown.values())
    return {source: found[0].data for source, found in shown.items() if found}


def picture(data: dict[str, Any]) -> np.ndarray:
    """Return the picture (N, 3) of a cell as colors, red first."""
    file = np.frombuffer(base64.b64decode(data["image/png"]), np.uint8)
    return cv2.imdecode(file, cv2.IMREAD_COLOR)[..., ::-1].reshape(-1, 3).astype(int)


def seen(colors: np.ndarray, color: Any) -> int:
    """Return the number of pixels that have a color of Matplotlib."""
    wanted = 255 * np.array(matplotlib.colors.to_rgb(color))
    return int((np.abs(colors - wanted).max(axis=1) < 8).sum())


@pytest.mark.needs("nbclient", "nbformat", "ipykernel")
def test_map_in_a_notebook_is_a_table_of_pictures(outputs):
    html = outputs["grid_map"]["text/html"]
    assert html.count("data:image/png;base64,") == 2
    assert "<th>layer</th>" in html
    assert {"image/png", "text/plain"} <= outputs["grid_map"].keys()


@pytest.mark.needs("nbclient", "nbformat", "ipykernel")
def test_plots_in_a_notebook_show_the_map(outputs):
    flat, slope, surface, relief = [
        picture(data) for source, data in outputs.items() if ".plot(" in source
    ]
    # The hatched hole, and both ends of the color maps.
    assert seen(flat, "0.9") > 200
    viridis, cividis = matplotlib.colormaps["viridis"], matplotlib.colormaps["cividis"]
    assert min(seen(flat, viridis(end)) for end in (0.0, 1.0)) > 100
    assert min(seen(slope, cividis(end)) for end in (0.0, 1.0)) > 100
    for drawn in (surface, relief):
        assert len(np.unique(drawn, axis=0)) > 1000
    # The cut sides of the block of terrain.
    assert seen(relief, (0.27, 0.26, 0.25)) + seen(relief, (0.32, 0.31, 0.30)) > 500
