# SPDX-License-Identifier: BSD-3-Clause
"""Import of message packages at the moment when a message is made.

Reading maps, bags and messages takes no message package, so that it works without ROS.
"""

import sys
from typing import Any

from grid_map_core_py.errors import required


def messages_of(package: str, needed_by: str = "this message", kind: str = "msg") -> Any:
    """Return the module with the message classes of a package, such as `nav_msgs.msg`.

    Args:
        package: name of the package.
        needed_by: name of the caller in the error.
        kind: "msg", or "srv" for services.

    Raises:
        MissingPackageError: the package is not installed, or its environment is not sourced.
    """
    name = f"{package}.{kind}"
    remedy = f"install ros-jazzy-{package.replace('_', '-')} and source ROS"
    return sys.modules.get(name) or required(name, needed_by, remedy)
