# SPDX-License-Identifier: BSD-3-Clause
from ..nodes import quiet_start

quiet_start()
