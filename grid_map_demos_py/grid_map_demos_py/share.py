# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Paths of installed files and of files that users name."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory


def share(*parts: str) -> Path:
    """Return the path of an installed file, such as `share("config", "simple_demo.yaml")`."""
    return Path(get_package_share_directory("grid_map_demos_py"), *parts)


def user_path(text: str) -> Path:
    """Return a path given by the user, with a leading `~` expanded."""
    try:
        return Path(text).expanduser()
    except RuntimeError:
        # An unknown user; opening the file reports that it does not exist.
        return Path(text)
