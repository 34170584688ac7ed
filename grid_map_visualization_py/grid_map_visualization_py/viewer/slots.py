# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Double buffering of the displayed map.

A browser takes a moment to load a surface. Each map is therefore loaded into a hidden place first,
and shown when it is ready.
"""

from itertools import count


class Slots:
    """Places for maps by number: some are shown, one may be loading.

    Attributes:
        shown: numbers of the places that are shown, the newest last.
    """

    def __init__(self) -> None:
        self.shown: list[int] = []
        self._loading: int | None = None
        self._replaces = False

    def load(self, *, replaces: bool) -> int:
        """Return the place for what comes next.

        Args:
            replaces: it takes the place of the newest, as another picture of the same map.
        """
        # What has not been shown yet may give way as well, and is no map of its own then.
        self._replaces = replaces and (self._loading is None or self._replaces)
        if self._loading is None:
            self._loading = next(slot for slot in count() if slot not in self.shown)
        return self._loading

    def turn(self, history: int) -> set[int]:
        """Show what was loaded, and at most `history` maps; return the places that are free now."""
        before = {*self.shown}
        if self._loading is not None:
            if self._replaces:
                del self.shown[-1:]
            self.shown.append(self._loading)
            self._loading = None
        del self.shown[:-history]
        return before - {*self.shown}
