# SPDX-License-Identifier: BSD-3-Clause
"""Internals of the `grid-map` command line; other packages use `grid_map_core_py.commands`."""

from ._arguments import (
    add_destination as add_destination,
    add_json as add_json,
    add_source as add_source,
    complete_layers as complete_layers,
    completed as completed,
)
from ._main import die_with_parent as die_with_parent, main as main, on_end as on_end
from ._maps import (
    Destination as Destination,
    check_free as check_free,
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
    message as message,
    print_json as print_json,
    print_table as print_table,
    table as table,
)
from ._tiles import (
    add_rectangle as add_rectangle,
    add_tiles as add_tiles,
    has_rectangle as has_rectangle,
    read_rectangle as read_rectangle,
    tiled_source as tiled_source,
    write_tiles as write_tiles,
)

__all__ = [name for name in dir() if not name.startswith("_")]
