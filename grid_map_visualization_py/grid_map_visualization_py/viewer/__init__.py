# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The parts of `web_viewer`.

`settings` says what somebody wants to see, `scene` makes it of a map, `picking` tells where a ray
meets it, and `page` shows it in a browser; `viewer` brings them together. None of them needs rclpy,
and `page` alone needs viser.
"""
