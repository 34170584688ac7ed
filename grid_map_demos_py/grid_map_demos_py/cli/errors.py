# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What goes wrong on the command line itself."""


class CommandError(Exception):
    """A command cannot do what it was asked for; the text tells why."""


class UsageError(CommandError):
    """The arguments are invalid, whatever is in the files."""
