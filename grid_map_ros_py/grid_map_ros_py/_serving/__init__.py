# SPDX-License-Identifier: BSD-3-Clause
"""Parts of nodes that serve maps: requests for parts and files, and maps of any size."""
