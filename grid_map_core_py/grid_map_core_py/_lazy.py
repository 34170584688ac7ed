# SPDX-License-Identifier: BSD-3-Clause
"""Imports the public names of a package when they are first used."""

import sys
from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from typing import Any

from .errors import hint


def lazy_names(
    package: str, offered: Mapping[str, str]
) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__all__`, `__getattr__` and `__dir__` of a package with lazy imports.

    `offered` maps each module to its public names, separated by spaces.
    """
    module_of = {name: module for module, names in offered.items() for name in names.split()}
    modules = [name.removeprefix(".") for name in offered]

    def find(name: str) -> Any:
        if name == "__version__":
            from importlib import metadata

            try:
                return metadata.version(package)
            except metadata.PackageNotFoundError:
                return "0+unknown"  # The package is not installed.
        if name in modules:
            return import_module(f"{package}.{name}")
        if name not in module_of:
            similar = hint(name, names())
            raise AttributeError(f"module {package!r} has no attribute {name!r}{similar}")
        found = getattr(import_module(module_of[name], package), name)
        setattr(sys.modules[package], name, found)
        return found

    def names() -> list[str]:
        public = (name for name in modules if name.isidentifier() and not name.startswith("_"))
        return sorted({*sys.modules[package].__all__, *public})

    return sorted(module_of), find, names


def public_names(names: Iterable[str]) -> tuple[list[str], Callable[[], list[str]]]:
    """Return `__all__` and `__dir__` of a package, without the private names in `names`."""
    public = [name for name in names if not name.startswith("_")]
    return public, lambda: public
