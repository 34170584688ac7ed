# SPDX-License-Identifier: BSD-3-Clause
"""Lazy imports: a package imports a public name only when the name is first used."""

import sys
from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from typing import Any

from .errors import hint


def lazy_names(
    package: str, offered: Mapping[str, str]
) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__all__`, `__getattr__` and `__dir__` for a package that imports names on first use.

    `__getattr__` also returns `__version__`; "0+unknown" means that the package is not installed.
    `offered` contains the public names of each module, separated by spaces.
    """
    module_of = {name: module for module, names in offered.items() for name in names.split()}
    modules = [name.removeprefix(".") for name in offered]

    def find(name: str) -> Any:
        if name == "__version__":
            from importlib import metadata

            try:
                return metadata.version(package)
            except metadata.PackageNotFoundError:
                return "0+unknown"
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
    """Return `__all__` and `__dir__` with the public names in `names`, the `dir()` of a package."""
    public = [name for name in names if not name.startswith("_")]
    return public, lambda: public
