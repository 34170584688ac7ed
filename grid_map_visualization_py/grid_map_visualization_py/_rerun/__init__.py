# SPDX-License-Identifier: BSD-3-Clause
"""Show maps and messages in Rerun: recording files, scenes, and the viewer page."""
