# SPDX-License-Identifier: BSD-3-Clause
"""The command line `grid-map`, and parts for subcommands of other packages.

A subcommand is a module with `add_arguments(parser)` and `run(options)`, which returns the exit
code; the first line of its docstring is its summary. A package adds a subcommand by an entry
point of the group `grid_map_core_py.commands`: the command's name and the module.
`grid-map --help` reads only the docstring, without an import, so it is fast, and a package that is
broken or missing leaves the other commands usable.

Data goes to standard output, all messages to standard error. Exit codes: 0, 1 after an error, 2 for
wrong arguments, 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP, 141 if the reader of the
output is gone.
"""

from ._arguments import (
    add_destination as add_destination,
    add_json as add_json,
    add_layers as add_layers,
    add_source as add_source,
    complete_layers as complete_layers,
    completed as completed,
)
from ._main import main as main
from ._maps import (
    Destination as Destination,
    check_free as check_free,
    describe as describe,
    open_recording as open_recording,
    open_records as open_records,
    read_map as read_map,
    source_format as source_format,
)
from ._output import (
    CommandError as CommandError,
    ProgressBar as ProgressBar,
    UsageError as UsageError,
    byte_count as byte_count,
    coordinate as coordinate,
    message as message,
    number as number,
    print_json as print_json,
    print_table as print_table,
    shown as shown,
    table as table,
)
from ._signals import die_with_parent as die_with_parent, on_end as on_end
from ._tiles import (
    add_rectangle as add_rectangle,
    add_tiles as add_tiles,
    has_rectangle as has_rectangle,
    read_rectangle as read_rectangle,
    tiled_source as tiled_source,
    write_tiles as write_tiles,
)

__all__ = [name for name in dir() if not name.startswith("_")]
