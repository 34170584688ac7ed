# SPDX-License-Identifier: BSD-3-Clause
"""Maps in notebooks."""

import base64
import re
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from hypothesis import given, settings

from grid_map_core_py import GridMap, color_vector_to_value
from grid_map_core_py.testing import grid_maps, moved_in_buffer


def decoded(png: bytes) -> np.ndarray:
    """Return a picture (height, width, 4) in BGRA."""
    return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)


def table(grid_map: GridMap) -> list[list[str]]:
    """Return the cells of the table, without the pictures."""
    text = grid_map._repr_html_().replace("&", "&amp;")
    tree = ElementTree.fromstring(re.sub(r"(<img [^>]*)>", r"\1/>", f"<div>{text}</div>"))
    return [["".join(cell.itertext()) for cell in row][:-1] for row in tree.iter("tr")]


def test_table_shows_pictures_ranges_and_missing_fraction():
    layers = {"elevation": [[1, np.nan]] + 3 * [[np.inf, 4]], "empty": np.nan, "color": 0.0}
    grid_map = GridMap((4, 2), 1.0, layers=layers, basic_layers=["elevation"], frame_id="odom")
    assert table(grid_map) == [
        ["layer", "min", "max", "mean", "NaN"],
        ["elevation", "1", "4", "3.25", "12.5%"],
        ["empty", "nan", "nan", "nan", "100.0%"],
        ["color", "", "", "", "0.0%"],
    ]
    text = grid_map._repr_html_()
    assert "<b>elevation</b>" in text
    assert "4 x 2 cells of 1 m" in text
    assert "&#x27;odom&#x27;" in text
    pictures = re.findall(r"data:image/png;base64,([^\"]+)", text)
    assert [decoded(base64.b64decode(p)).shape for p in pictures] == 3 * [(48, 96, 4)]


def test_names_cannot_break_the_page():
    grid_map = GridMap((1, 1), 1.0, layers=['<script>"&'], frame_id="<b>")
    text = grid_map._repr_html_()
    assert "<script>" not in text
    assert "<b>" not in text
    assert text.count("&lt;script&gt;&quot;&amp;") == 2


@pytest.mark.parametrize("start", [(0, 0), (2, 1)])
def test_picture_has_x_to_the_right_and_y_upwards(start):
    grid_map = GridMap((4, 2), 1.0, layers={"a": 0.0})
    grid_map["a"][0, 0] = 1.0  # largest x and y
    grid_map["a"][3, 0] = np.nan  # smallest x, largest y
    picture = decoded(moved_in_buffer(grid_map, start)._repr_png_())
    assert picture.shape == (240, 480, 4)
    yellow, dark = picture[0, -1].astype(int), picture[-1, -1].astype(int)
    assert yellow[2] > 200 > yellow[0]
    assert dark[:3].max() < 100
    assert picture[0, 0, 3] == 0
    assert picture[-1, 0, 3] == 255


def test_picture_shows_the_first_basic_layer_else_the_first():
    grid_map = GridMap((1, 1), 1.0, layers=["a", "my_color"])
    grid_map["my_color"] = color_vector_to_value((1, 2, 3))
    assert decoded(grid_map._repr_png_())[0, 0, 3] == 0
    grid_map.basic_layers = ["my_color"]
    assert decoded(grid_map._repr_png_())[0, 0].tolist() == [3, 2, 1, 255]
    empty = GridMap((1, 1), 1.0)
    assert (len(table(empty)), empty._repr_png_()) == (1, None)


@settings(max_examples=25)
@given(grid_maps(("elevation", "color")))
def test_every_map_has_a_table_and_a_picture(grid_map):
    assert len(table(grid_map)) == 3
    picture = decoded(grid_map._repr_png_())
    assert max(picture.shape[:2]) == 480
    assert (picture[..., 3] == 0).any() == np.isnan(grid_map["elevation"]).any()
