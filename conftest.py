# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Settings of the tests of all packages and of the workspace."""

import os
from pathlib import Path

PROFILE = Path(__file__).parent / "tools" / "fastdds_tests.xml"

os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(PROFILE))
