# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Settings of all tests of this package."""

from grid_map_core_py.testing import register_profiles

register_profiles()
