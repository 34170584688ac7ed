# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Settings of all tests of this package."""

from hypothesis import settings

# How long an example takes says more about the machine than about the code.
settings.register_profile("grid_map", deadline=None)
settings.load_profile("grid_map")
