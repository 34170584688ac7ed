# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The visualizations that come with this package, one per file, named after their YAML type."""
