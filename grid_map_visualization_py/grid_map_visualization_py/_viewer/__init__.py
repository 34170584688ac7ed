# SPDX-License-Identifier: BSD-3-Clause
"""Components of `web_viewer`.

`scene` converts a map to arrays and meshes (`glb`) for the browser, `page` serves the web page with
controls and `texts`, and `viewer` connects all. No module needs rclpy; only `page` needs viser.
"""
