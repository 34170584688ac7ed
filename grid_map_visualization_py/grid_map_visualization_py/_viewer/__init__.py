# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The parts of `web_viewer`.

`settings` holds the choices of the user, `scene` applies them to a map, `picking` finds the clicked
point, `page` shows the scene in a browser, and `viewer` brings them together. None of them needs
rclpy, and only `page` needs viser.
"""
