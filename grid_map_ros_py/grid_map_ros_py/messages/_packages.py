# SPDX-License-Identifier: BSD-3-Clause
"""Imports message packages lazily, so that messages can be read without ROS."""

import array
import sys
from typing import Any

from grid_map_core_py.errors import required


def messages_of(package: str, needed_by: str = "this message", kind: str = "msg") -> Any:
    """Import a message module such as `nav_msgs.msg`; an error names `needed_by`."""
    name = f"{package}.{kind}"
    return sys.modules.get(name) or required(name, needed_by)


def set_array(message: Any, values: "array.array[Any]") -> None:
    """Set `message.data` to an array of the field type without copying it."""
    message._data = values
