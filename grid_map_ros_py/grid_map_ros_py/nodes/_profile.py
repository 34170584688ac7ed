# SPDX-License-Identifier: BSD-3-Clause
"""Fast DDS settings for large maps and clouds."""

import os
import shutil
from contextlib import suppress
from pathlib import Path

PROFILE = Path(__file__).parents[1] / "fastdds_large_maps.xml"
VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""Environment variables for the profile: up to Fast DDS 2 (ROS 2 Jazzy), and from Fast DDS 3 on."""

CHOICES = (*VARIABLES, "FASTDDS_BUILTIN_TRANSPORTS")
"""Environment variables that select other Fast DDS settings; the profile is then not used."""

SHARED_MEMORY = 2**28
"""Free shared memory that the profile requires [bytes]; Docker containers have 64 MB by default."""


def use_profile() -> None:
    """Select the Fast DDS profile for large maps; call this before `rclpy.init`."""
    # `/dev/shm` exists only on Linux.
    with suppress(OSError):
        is_free = shutil.disk_usage("/dev/shm").free >= SHARED_MEMORY
        if is_free and not any(map(os.environ.get, CHOICES)):
            os.environ.update(dict.fromkeys(VARIABLES, str(PROFILE)))
