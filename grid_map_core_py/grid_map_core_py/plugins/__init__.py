# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Parts for plug-ins: registries of classes, and dataclasses built from YAML parameters."""

from ._parameters import build, cast, check, describe, mismatch, nested
from ._registry import Registry

__all__ = [
    "Registry",
    "build",
    "cast",
    "check",
    "describe",
    "mismatch",
    "nested",
]
