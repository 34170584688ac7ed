# SPDX-License-Identifier: BSD-3-Clause
"""Components of `web_viewer`.

`scene` converts a map to arrays for the browser, and `glb` converts meshes. `page` serves the web
page with its controls. `axes` and `texts` provide its axes and texts. `viewer` passes maps and
settings between these modules. No module needs rclpy, and only `page` needs viser.
"""
