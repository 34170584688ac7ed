# SPDX-License-Identifier: BSD-3-Clause
"""Runs the command line `grid-map`, as `python3 -m grid_map_core_py`."""

import signal
import sys

# Until `main` sets a handler, Ctrl-C ends the process immediately, without a traceback.
signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])

from ._commands import main  # noqa: E402

if __name__ == "__main__":
    sys.exit(main())
