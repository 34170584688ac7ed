# SPDX-License-Identifier: BSD-3-Clause
"""Definitions of installed message types, which recorders store in bags."""

import re
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

_FIELD = re.compile(r"^\s*([A-Za-z]\w*/)?([A-Z]\w*)(\[[^]]*\])?\s+[a-z]", re.MULTILINE)
"""A field with a message as its type; names of elementary types begin with a small letter."""


def definition_of(type_name: str) -> str:
    """Return the definition of a message type, followed by those of all nested types.

    Args:
        type_name: name of the type, such as `nav_msgs/msg/Odometry`.

    Returns:
        The text as `ros2msg` of MCAP has it; empty if a file is not installed.
    """
    package, _, name = type_name.split("/")
    texts: dict[str, str] = {}
    pending = [f"{package}/{name}"]
    while pending:
        full_name = pending.pop()
        if full_name in texts:
            continue
        package, _, name = full_name.partition("/")
        try:
            path = Path(get_package_share_directory(package), "msg", f"{name}.msg")
            texts[full_name] = path.read_text(encoding="utf-8")
        except (PackageNotFoundError, OSError):
            return ""
        nested = _FIELD.findall(texts[full_name])
        pending += [f"{given or f'{package}/'}{kind}" for given, kind, _ in reversed(nested)]
    (_, first), *others = texts.items()
    parts = [first, *(f"MSG: {full_name}\n{text}" for full_name, text in others)]
    return f"\n{'=' * 80}\n".join(parts)
