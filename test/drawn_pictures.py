# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of the documentation are small, shown on their pages, and drawn by their scripts.

`make pictures` runs these tests. Pictures of the viewers are not drawn here: other tests look at
the same pages in the browser.
"""

import sys
from xml.etree import ElementTree

import pytest

from grid_map_ros_py.testing import environment
from scratch import ROOT, run

IMAGES = ROOT / "docs" / "images"


@pytest.mark.parametrize(
    ("script", "folder", "page", "each", "total"),
    [
        ("make_filter_pictures.py", "filters", "docs/filters/{}.md", 300_000, 2_000_000),
        (
            "make_visualization_pictures.py",
            "visualizations",
            "docs/visualizations/{}.md",
            300_000,
            600_000,
        ),
        ("make_demo_pictures.py", "demos", "docs/demos/{}.md", 150_000, 1_000_000),
        ("make_drawings.py", "conventions", "docs/conventions.md", 20_000, 60_000),
        ("make_picture_pictures.py", "pictures", "docs/pictures.md", 300_000, 1_000_000),
        ("make_xarray_picture.py", "xarray", "docs/xarray.md", 200_000, 200_000),
        ("make_elevation_picture.py", "elevation", "docs/elevation_model.md", 50_000, 50_000),
        ("make_tutorial_picture.py", "tutorial", "docs/tutorial.md", 300_000, 300_000),
        ("make_nav2_picture.py", "nav2", "docs/nav2.md", 150_000, 150_000),
        ("make_hero_picture.py", "", "README.md", 300_000, 300_000),
    ],
)
def test_pictures_are_small_shown_and_drawn_by_their_script(
    script, folder, page, each, total, tmp_path
):
    done = run(sys.executable, IMAGES / script, tmp_path, environ=environment())
    assert done.returncode == 0, done.stderr
    stored = sorted((IMAGES / folder).glob("*" if folder else "traversability.png"))
    assert [path.name for path in stored] == sorted(path.name for path in tmp_path.iterdir())
    for path in stored:
        if path.suffix == ".svg":
            assert path.read_text() == (tmp_path / path.name).read_text()
        else:
            kind = b"GIF89a" if path.suffix == ".gif" else b"\x89PNG"
            assert path.read_bytes().startswith(kind)
        link = f"images/{folder}/{path.name}" if folder else f"images/{path.name}"
        assert f"{link})" in (ROOT / page.format(path.stem)).read_text()
    sizes = [path.stat().st_size for path in stored]
    assert (max(sizes) < each, sum(sizes) < total) == (True, True)


# --- figures of the page about conventions: how cells lie -----------------------------------------

CELL = 36
"""Side of a cell in the figure of moves [px]."""


def places(figure: str, word: str) -> list[tuple[float, float]]:
    """Return the place of a word: right and down from the upper left corner of a figure."""
    texts = ElementTree.parse(IMAGES / "conventions" / f"{figure}.svg").iter(
        "{http://www.w3.org/2000/svg}text"
    )
    return [(float(text.get("x")), float(text.get("y"))) for text in texts if text.text == word]


@pytest.mark.parametrize("letter", "ABDEGH")
def test_move_keeps_data_in_place_and_new_position_shifts_it(letter):
    before, moved, shifted = (
        (right - origin[0], down - origin[1])
        for (right, down), origin in zip(places("move", letter), places("move", "x"), strict=True)
    )
    assert moved == before
    assert shifted == (before[0] - CELL, before[1] - CELL)


def test_letters_are_at_their_buffer_index():
    numbers = {str(number): places("buffer", str(number)) for number in range(4)}
    for letter in "ABDEGH":
        (right, down), (seen_right, seen_down) = places("buffer", letter)
        row = next(n for n, found in numbers.items() if (down in {y for _, y in found}))
        column = next(n for n, found in numbers.items() if (right in {x for x, _ in found}))
        assert places("buffer", f"{row}, {column}") == [(seen_right, seen_down + 16)]
