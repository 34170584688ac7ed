# SPDX-License-Identifier: BSD-3-Clause
"""List the public names of the packages, with their signatures, in docs/api.txt.

Usage: tools/api.py [--check]

A name is public if it is in `__all__` of a public module. Each object is listed once, under its
shortest import name; methods follow their class. `--check` writes nothing, and fails if the file
differs.
"""

import dataclasses
import enum
import importlib
import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parent.parent
FILE = ROOT / "docs" / "api.txt"
PACKAGES = [f"grid_map_{name}_py" for name in ("core", "filters", "ros", "visualization", "demos")]


def public_modules(package: str) -> Iterator[ModuleType]:
    """Yield the modules of a package whose dotted names have no private part."""
    folder = ROOT / package / package
    for path in sorted(folder.rglob("*.py")):
        parts = path.relative_to(folder.parent).with_suffix("").parts
        parts = parts[:-1] if parts[-1] == "__init__" else parts
        if not any(part.startswith("_") for part in parts):
            yield importlib.import_module(".".join(parts))


def signature(found: object) -> str:
    """Return the parameters of a callable as text, without memory addresses of default objects."""
    try:
        text = str(inspect.signature(found))  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return ""
    return re.sub(r" at 0x[0-9a-f]+", "", re.sub(r"<(\w+)\.(\w+): [^>]*>", r"\1.\2", text))


def lines_of_class(cls: type) -> Iterator[str]:
    """Yield one line per public method, property and enum member."""
    if issubclass(cls, enum.Enum):
        yield from (f"    .{member.name}" for member in cls)
        return
    fields = (
        {field.name for field in dataclasses.fields(cls)}
        if dataclasses.is_dataclass(cls)
        else set()
    )
    for name, found in sorted(vars(cls).items()):
        if name.startswith("_") or name in fields:
            continue
        inner = found.__func__ if isinstance(found, classmethod | staticmethod) else found
        yield f"    .{name}{signature(inner) if callable(inner) else ''}"


def entries(package: str) -> Iterator[list[str]]:
    """Yield the lines that describe each public object."""
    names: dict[int, str] = {}
    objects: dict[int, object] = {}
    for module in public_modules(package):
        for name in getattr(module, "__all__", ()):
            found = getattr(module, name)
            if isinstance(found, ModuleType):
                continue
            # Python shares one object for equal small values such as numbers.
            key = id(found) if callable(found) else hash((name, repr(found)))
            full = f"{module.__name__}.{name}"
            if key not in names or (full.count("."), full) < (names[key].count("."), names[key]):
                names[key], objects[key] = full, found
    for key, full in sorted(names.items(), key=lambda item: item[1]):
        found = objects[key]
        if inspect.isclass(found):
            parameters = "" if issubclass(found, enum.Enum | BaseException) else signature(found)
            yield [f"class {full}{parameters}", *lines_of_class(found)]
        else:
            yield [f"{full}{signature(found) if callable(found) else ''}"]


def main() -> int:
    """Write or check the file; return the exit code."""
    listed = [entry for package in PACKAGES for entry in entries(package)]
    text = f"{len(listed)} public names\n\n" + "".join("\n".join(entry) + "\n" for entry in listed)
    if "--check" not in sys.argv:
        FILE.write_text(text)
    elif not FILE.exists() or FILE.read_text() != text:
        print("docs/api.txt differs from the code: run `make tables`", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
