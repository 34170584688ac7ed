# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`python3 -m grid_map_core_py.commands`."""

import sys

from ._main import main

if __name__ == "__main__":
    sys.exit(main())
