# SPDX-License-Identifier: BSD-3-Clause
"""`python3 -m grid_map_core_py`, the command line `grid-map`."""

import signal
import sys

# Until `main` handles it, Ctrl-C ends the process at once and without a traceback.
signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])

from ._commands import main  # noqa: E402

if __name__ == "__main__":
    sys.exit(main())
