# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of the documentation are small, shown on their pages, and drawn by their scripts."""

import sys

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
        ("make_demo_pictures.py", "demos", "docs/demos/{}.md", 80_000, 800_000),
        ("make_drawings.py", "conventions", "docs/conventions.md", 20_000, 60_000),
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
            assert path.read_bytes().startswith(b"\x89PNG")
        link = f"images/{folder}/{path.name}" if folder else f"images/{path.name}"
        assert f"{link})" in (ROOT / page.format(path.stem)).read_text()
    sizes = [path.stat().st_size for path in stored]
    assert (max(sizes) < each, sum(sizes) < total) == (True, True)
