# SPDX-License-Identifier: BSD-3-Clause
"""Maps and messages in Rerun: recordings, and the page that shows them."""
