# SPDX-License-Identifier: BSD-3-Clause
"""Components of `web_viewer`. They do not require rclpy, and only `page` requires viser."""
