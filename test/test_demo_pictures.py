# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of the README and of the pages on demos are drawn by their scripts."""

import sys
from pathlib import Path

from grid_map_ros_py.testing import environment
from scratch import ROOT, run

PNG = b"\x89PNG"

IMAGES = ROOT / "docs" / "images"


def draw(script: str, folder: Path) -> set[str]:
    """Let a script draw into a folder, and return the names of its pictures."""
    done = run(sys.executable, IMAGES / script, folder, environ=environment(), cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return {path.name for path in folder.iterdir()}


def test_demo_pictures_are_small_and_drawn_by_their_script(tmp_path):
    stored = [*(IMAGES / "demos").iterdir()]
    assert draw("make_demo_pictures.py", tmp_path) == {path.name for path in stored}
    for path in stored:
        assert path.read_bytes().startswith(PNG)
        assert path.stat().st_size < 80_000
        page = ROOT / "docs" / "demos" / f"{path.stem}.md"
        assert f"../images/demos/{path.name}" in page.read_text()


def test_readme_picture_is_small_and_drawn_by_its_script(tmp_path):
    assert draw("make_hero_picture.py", tmp_path) == {"traversability.png"}
    stored = IMAGES / "traversability.png"
    assert stored.read_bytes().startswith(PNG)
    assert stored.stat().st_size < 300_000
    assert "docs/images/traversability.png" in (ROOT / "README.md").read_text()
