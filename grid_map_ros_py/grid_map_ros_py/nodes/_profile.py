# SPDX-License-Identifier: BSD-3-Clause
"""Settings of Fast DDS with which large maps and clouds arrive."""

import os
import shutil
from contextlib import suppress
from pathlib import Path

PROFILE = Path(__file__).parents[1] / "fastdds_large_maps.xml"
CHOICES = (
    "FASTRTPS_DEFAULT_PROFILES_FILE",
    "FASTDDS_DEFAULT_PROFILES_FILE",
    "FASTDDS_BUILTIN_TRANSPORTS",
)
"""Variables by which a user chooses other settings."""

SHARED_MEMORY = 2**28
"""Free shared memory that the profile requires [bytes]; a container has 64 MB by default."""


def use_profile() -> None:
    """Let Fast DDS use the profile for large maps, unless the user has chosen settings.

    Call it before `rclpy.init`. It matters in processes that publish.
    """
    # Elsewhere than on Linux there is no such folder.
    with suppress(OSError):
        is_free = shutil.disk_usage("/dev/shm").free >= SHARED_MEMORY
        if is_free and not any(map(os.environ.get, CHOICES)):
            os.environ[CHOICES[0]] = str(PROFILE)
