# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`python3 -m grid_map_demos_py.cli`."""

import sys

from .main import main

sys.exit(main())
