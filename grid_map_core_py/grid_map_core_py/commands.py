# SPDX-License-Identifier: BSD-3-Clause
"""Building blocks for `grid-map` commands in other packages.

A command is a module with `add_arguments(parser)` and `run(options)`, which returns the exit code.
A package adds a command through an entry point in the group `grid_map_core_py.commands`. The name
of the entry point is the command, and its value is the module. `grid-map NAME --help` shows the
first line of the module's docstring.

Data goes to standard output, messages to standard error. Exit codes are 0 for success,
1 for an error, 2 for invalid arguments, and 128 plus the signal number after a signal.
"""

from . import _lazy
from ._commands import (
    CommandError as CommandError,
    add_source as add_source,
    print_table as print_table,
    read_map as read_map,
)

__all__, __dir__ = _lazy.public_names(dir())
