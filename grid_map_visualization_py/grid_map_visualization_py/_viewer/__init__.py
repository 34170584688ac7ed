# SPDX-License-Identifier: BSD-3-Clause
"""The parts of `web_viewer`.

`scene` turns a map into what the browser draws (`glb`), `page` shows it there beside the controls
and `texts`, and `viewer` brings them together. None of them needs rclpy, and only `page` needs
viser.
"""
