# SPDX-License-Identifier: BSD-3-Clause
"""Imports message packages lazily, when a message is created: reading works without ROS."""

import array
import sys
from typing import Any

from grid_map_core_py.errors import required


def messages_of(package: str, needed_by: str = "this message", kind: str = "msg") -> Any:
    """Return the module with the message classes of a package, such as `nav_msgs.msg`.

    The error of a missing package names `needed_by`. `kind` is "msg", or "srv" for services.
    """
    name = f"{package}.{kind}"
    remedy = f"install ros-jazzy-{package.replace('_', '-')} and source ROS"
    return sys.modules.get(name) or required(name, needed_by, remedy)


def set_array(message: Any, values: "array.array[Any]") -> None:
    """Set the `data` of a message to an array without a copy.

    The constructor and the setter that rosidl generates copy it. The array must have the type of
    the field.
    """
    message._data = values
