# SPDX-License-Identifier: BSD-3-Clause
"""Base class of nodes that are executables."""

from collections.abc import Collection
from typing import Any, TypeVar

from rclpy.node import Node

from grid_map_core_py.plugins import check

from ._parameters import read_limits, read_parameter, read_positive, read_topic
from ._spin import run

T = TypeVar("T")
N = TypeVar("N", int, float)


class ConfiguredNode(Node):
    """A node that reads its parameters in `__init__`, and has those of `read_limits`.

    An entry point of the package names its method `main`.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        read_limits(self)

    @classmethod
    def main(cls) -> int:
        """Run the node until an interrupt or a shutdown; return the exit code."""
        return run(cls)

    def read(self, name: str, default: T, description: str) -> T:
        """Return a parameter, which has the type of its default."""
        return read_parameter(self, name, type(default), default, description=description)

    def read_number(self, name: str, default: N, low: float, high: float, description: str) -> N:
        """Return a parameter that is a number from `low` to `high`."""
        value = self.read(name, default, description)
        check(low <= value <= high, name, f"a number from {low:g} to {high:g}", value)
        return value

    def read_positive(self, name: str, default: float, description: str) -> float:
        """Return a parameter that is a positive number."""
        return read_positive(self, name, default, description=description)

    def read_choice(
        self, name: str, choices: Collection[str], default: str, description: str
    ) -> str:
        """Return a parameter that is one of the choices."""
        value = self.read(name, default, description)
        check(value in choices, name, f"one of {', '.join(choices)}", value)
        return value

    def read_topic(self, name: str, default: str, description: str) -> str:
        """Return a parameter that names a topic or a service; see `read_topic`."""
        return read_topic(self, name, default, description=description)
