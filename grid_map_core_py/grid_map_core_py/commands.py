# SPDX-License-Identifier: BSD-3-Clause
"""Parts for commands of `grid-map` in your own package.

A command is a module with `add_arguments(parser)` and `run(options)`, which returns the exit code.
A package adds it through an entry point of the group `grid_map_core_py.commands`: the name of the
command and the module. The first line of the module's docstring describes it in
`grid-map NAME --help`.

Data goes to standard output, messages to standard error. Exit codes: 0; 1 after an error; 2 for
wrong arguments; 128 plus its number after a signal.
"""

from ._commands import (
    CommandError as CommandError,
    add_source as add_source,
    print_table as print_table,
    read_map as read_map,
)

__all__ = [name for name in dir() if not name.startswith("_")]
