# SPDX-License-Identifier: BSD-3-Clause
"""Imports message packages lazily, so that messages can be read without ROS."""

import array
import sys
from typing import Any

from grid_map_core_py.errors import required


def messages_of(package: str, needed_by: str = "this message", kind: str = "msg") -> Any:
    """Import the module with the message classes of a package, such as `nav_msgs.msg`.

    `kind` is "msg", or "srv" for services. If the package is missing, the error names `needed_by`.
    """
    name = f"{package}.{kind}"
    return sys.modules.get(name) or required(name, needed_by)


def set_array(message: Any, values: "array.array[Any]") -> None:
    """Set the field `data` of a message to an array of the field type, without copying."""
    message._data = values
