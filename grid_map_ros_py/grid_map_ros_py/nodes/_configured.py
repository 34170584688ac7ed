# SPDX-License-Identifier: BSD-3-Clause
"""Base class of nodes that are executables."""

import math
from collections.abc import Collection
from typing import Any, TypeVar

from rclpy.node import Node

from grid_map_core_py.plugins import check

from ._parameters import check_topic, read_limits, read_parameter
from ._spin import run

T = TypeVar("T")
N = TypeVar("N", int, float)

EXTREMES = (1e-9, 1e9)
"""Smallest and largest positive parameter: the period of such a rate still fits a ROS timer."""


class ConfiguredNode(Node):
    """A node that reads its parameters in `__init__`, and has those of `read_limits`.

    Use `main` as the entry point of the executable.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        read_limits(self)

    @classmethod
    def main(cls) -> int:
        """Run the node until an interrupt or a shutdown; return the exit code."""
        return run(cls)

    def read(self, name: str, default: T, description: str) -> T:
        """Return a parameter that has the type of its default."""
        return read_parameter(self, name, type(default), default, description=description)

    def read_number(self, name: str, default: N, low: float, high: float, description: str) -> N:
        """Return a parameter that is a number from `low` to `high`."""
        value = self.read(name, default, description)
        check(low <= value <= high, name, f"a number from {low:g} to {high:g}", value)
        return value

    def read_numbers(self, name: str, default: list[float], description: str) -> list[float]:
        """Return a parameter that is a list of finite numbers, as long as its default."""
        value = read_parameter(self, name, list[float], default, description=description)
        fits = len(value) == len(default) and all(map(math.isfinite, value))
        check(fits, name, f"{len(default)} finite numbers", value)
        return value

    def read_positive(self, name: str, default: float, description: str) -> float:
        """Return a parameter that is a positive number, such as a rate or a time."""
        value, (low, high) = self.read(name, default, description), EXTREMES
        check(low <= value <= high, name, f"a positive number from {low:g} to {high:g}", value)
        return value

    def read_choice(
        self, name: str, choices: Collection[str], default: str, description: str
    ) -> str:
        """Return a parameter that is one of the choices."""
        value = self.read(name, default, description)
        check(value in choices, name, f"one of {', '.join(choices)}", value)
        return value

    def read_topic(self, name: str, default: str, description: str) -> str:
        """Return a parameter that names a topic or a service; empty only if its default is."""
        topic = self.read(name, default, description)
        return check_topic(self, name, topic) if topic or default else ""
