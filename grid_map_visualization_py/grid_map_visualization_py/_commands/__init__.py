# SPDX-License-Identifier: BSD-3-Clause
"""Subcommands of `grid-map` that this package adds."""
