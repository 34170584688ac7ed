# SPDX-License-Identifier: BSD-3-Clause
"""Write maps and messages to Rerun recordings, and serve recordings to browsers."""
