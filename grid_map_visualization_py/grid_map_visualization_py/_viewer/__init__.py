# SPDX-License-Identifier: BSD-3-Clause
"""Components of `web_viewer`.

`scene` converts a map to arrays for the browser, and `glb` converts meshes. `page` serves the web
page with its controls, and `axes` and `texts` create its axes and tables. `viewer` connects these
modules. None of them requires rclpy, and only `page` requires viser.
"""
