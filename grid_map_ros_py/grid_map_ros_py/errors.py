# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Every error of this package.

GridMapError (grid_map_core_py)
├── MessageError (ValueError)
└── ConfigError (grid_map_core_py)
    └── ParameterError
"""

from grid_map_core_py.errors import ConfigError, GridMapError


class MessageError(GridMapError, ValueError):
    """A message, or a value meant for one, does not hold what it must.

    Attributes:
        field: path of the field in the message, such as `data[0].layout.dim[1].size`.
        expected: what it must hold, in words.
        found: what it holds.
    """

    def __init__(self, field: str, expected: str, found: object) -> None:
        self.field = field
        self.expected = expected
        self.found = found
        super().__init__(field, expected, found)

    def __str__(self) -> str:
        return f"{self.field}: expected {self.expected}, found {self.found!r}"


class ParameterError(ConfigError):
    """A parameter of a node is missing or has a value of the wrong type.

    Attributes:
        name: full name of the parameter.
        expected: what it must be, in words.
        found: what it is, in words.
    """

    def __init__(self, name: str, expected: str, found: str) -> None:
        self.name = name
        self.expected = expected
        self.found = found
        super().__init__(name, expected, found)

    def __str__(self) -> str:
        return f"parameter {self.name!r}: expected {self.expected}, found {self.found}"
