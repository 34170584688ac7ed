# SPDX-License-Identifier: BSD-3-Clause
"""Filter chains of another package, which this one may not import.

A package offers a class of chains by an entry point of the group `grid_map_ros_py.chains`.
"""

from collections.abc import Mapping
from importlib.metadata import entry_points
from typing import Any, Protocol

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Size
from grid_map_core_py.errors import MissingPackageError

GROUP = "grid_map_ros_py.chains"
PACKAGE = "grid_map_filters_py"


class Chain(Protocol):
    """Filters that run one after the other; `FilterChain` of `grid_map_filters_py` is one."""

    def without_copies(
        self, grid_map: GridMap, *, warnings: list[str] | None = None
    ) -> tuple[GridMap, Size]:
        """Return the filtered map in map order, and the start index that it is to have.

        Warnings of the filters are appended to a list.
        """


def make_chain(config: Mapping[str, Any], threads: int = 1) -> Chain:
    """Return the chain of a configuration.

    Raises:
        MissingPackageError: no installed package has chains.
        ConfigError: the configuration is invalid.
    """
    found = next(iter(entry_points(group=GROUP)), None)
    if found is None:
        remedy = f"install {PACKAGE}, or source the workspace that has it"
        raise MissingPackageError(PACKAGE, "postprocessor_pipeline", remedy)
    chain: Chain = found.load().from_config(config, threads=threads)
    return chain
