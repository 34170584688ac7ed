# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The filters of this package, one per module; `registry` lists them under their YAML types."""
