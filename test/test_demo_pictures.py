# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of the pages on demos are drawn by their script."""

import sys

from grid_map_ros_py.testing import environment
from scratch import ROOT, run


def test_the_pictures_of_demos_are_small_and_drawn_by_their_script(tmp_path):
    script = ROOT / "docs" / "images" / "make_demo_pictures.py"
    done = run(sys.executable, script, tmp_path / "new", environ=environment(), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    stored = [*(ROOT / "docs" / "images" / "demos").iterdir()]
    assert {path.name for path in (tmp_path / "new").iterdir()} == {path.name for path in stored}
    for path in stored:
        assert path.read_bytes().startswith(b"\x89PNG")
        assert path.stat().st_size < 80_000
        assert (
            f"../images/demos/{path.name}"
            in (ROOT / "docs" / "demos" / f"{path.stem}.md").read_text()
        )
