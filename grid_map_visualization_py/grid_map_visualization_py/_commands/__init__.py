# SPDX-License-Identifier: BSD-3-Clause
"""Subcommands that this package adds to `grid-map`."""
