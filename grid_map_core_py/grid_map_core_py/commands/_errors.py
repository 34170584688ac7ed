# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Errors of the command line itself."""

from ..errors import GridMapError


class CommandError(GridMapError):
    """A command failed: exit code 1."""


class UsageError(CommandError):
    """The arguments are invalid, independent of the files: exit code 2."""
