# SPDX-License-Identifier: BSD-3-Clause
"""Helpers for plug-ins: class registries and parameter checks.

Filters and visualizations are plug-ins. Each plug-in is a dataclass whose fields are its
parameters. A `Registry` finds a class by its YAML type name in all installed packages. `check`
rejects invalid parameter values.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar

from ._parameters import check as check
from .errors import ConfigError, hint

__all__ = ["check"]

T = TypeVar("T")


@dataclass(frozen=True)
class Registry(Generic[T]):
    """Mapping from type names to classes, either built in or loaded through entry points.

    Attributes:
        built_in: built-in classes by type name.
        group: entry-point group, searched on first use. Each entry point has the type name as its
            name, and its value refers to the class.
    """

    built_in: Mapping[str, type[T]]
    group: str

    def __getitem__(self, type_name: str) -> type[T]:
        """Return the class named `type_name`; raise `ConfigError` if it cannot be loaded."""
        plugins = self._plugins
        if type_name in plugins:
            entry = plugins[type_name]
            try:
                loaded: type[T] = entry.load()
            except Exception as error:  # a plug-in may raise any error; the message names it
                raise ConfigError(f"cannot load {entry.value!r}: {error}") from error
            return loaded
        if type_name in self.built_in:
            return self.built_in[type_name]
        package = type_name.rpartition("/")[0]
        names = self.types if package else {*self.built_in, *plugins}
        text = hint(type_name, names, 3) or f"; known: {', '.join(self.types)}."
        if package and package not in {name.rpartition("/")[0] for name in self.types}:
            text += f" No installed package adds types of {package!r}; is its workspace sourced?"
        raise ConfigError(f"unknown type {type_name!r}{text}")

    @property
    def types(self) -> tuple[str, ...]:
        """Sorted type names of all classes, built-in or from entry points."""
        return tuple(sorted({*self.built_in, *self._plugins}))

    @cached_property
    def _plugins(self) -> dict[str, EntryPoint]:
        plugins: dict[str, EntryPoint] = {}
        # A package that is on the Python path twice yields each entry point twice.
        for entry in dict.fromkeys(entry_points(group=self.group)):
            if entry.name in self.built_in or entry.name in plugins:
                other = plugins[entry.name].value if entry.name in plugins else "a built-in"
                raise ConfigError(
                    f"the type {entry.name!r} is registered twice: as {entry.value} and as {other}"
                )
            plugins[entry.name] = entry
        return plugins
