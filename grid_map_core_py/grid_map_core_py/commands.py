# SPDX-License-Identifier: BSD-3-Clause
"""Functions for `grid-map` commands of other packages.

A command is a module with the functions `add_arguments(parser)` and `run(options)`. `run` returns
the exit code. `grid-map NAME --help` shows the first line of the module's docstring.

A package registers a command as an entry point in the group `grid_map_core_py.commands`. The name
of the entry point is the command, and its value is the module.

Data goes to standard output, and messages to standard error. Exit codes are 0 for success, 1 for an
error, 2 for invalid arguments, and 128 plus the signal number after a signal.
"""

from . import _lazy
from ._commands import (
    CommandError as CommandError,
    add_source as add_source,
    print_table as print_table,
    read_map as read_map,
)

__all__, __dir__ = _lazy.public_names(dir())
