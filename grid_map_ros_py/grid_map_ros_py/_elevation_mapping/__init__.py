# SPDX-License-Identifier: BSD-3-Clause
"""Parts of the node `elevation_mapping`: settings, sources, cameras and fusion."""
