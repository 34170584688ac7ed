# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Paths of files of this package and of files that users name."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory

PACKAGE = "grid_map_demos_py"


def share(*parts: str) -> Path:
    """Return the path of an installed file, such as `share("config", "simple_demo.yaml")`."""
    return Path(get_package_share_directory(PACKAGE), *parts)


def user_path(text: str) -> Path:
    """Return the path that a user has written, who may begin it with `~`."""
    try:
        return Path(text).expanduser()
    except RuntimeError:
        # The home of somebody unknown; whoever opens this file says that there is none.
        return Path(text)
