# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The command line `grid-map`: maps in files, without a running ROS graph.

Every subcommand is a module of its name with `HELP`, `add_arguments(parser)` and `run(options)`.
What takes long to import, or may not be installed, is imported by those who need it when they need
it.

Data goes to standard output and everything else to standard error. Exit codes: 0, 1 after an error,
2 for arguments that are invalid, 130 after an interrupt, 143 after SIGTERM, 141 if nobody reads
the output.
"""
