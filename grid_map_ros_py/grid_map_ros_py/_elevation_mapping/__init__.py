# SPDX-License-Identifier: BSD-3-Clause
"""Parts of the `elevation_mapping` node: settings, sources, cameras and fusion."""
