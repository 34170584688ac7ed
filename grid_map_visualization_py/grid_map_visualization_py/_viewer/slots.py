# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Double buffering of the maps on the page.

A browser needs a moment to load a surface. Each map is therefore loaded into a hidden slot and
shown at the next turn, so that no gap is visible.
"""

from itertools import count


class Slots:
    """Numbered slots for maps: some are shown, one may be loading.

    Attributes:
        shown: numbers of the slots that are shown, the newest last.
    """

    def __init__(self) -> None:
        self.shown: list[int] = []
        self._loading: int | None = None
        self._replaces = False

    def load(self, *, replaces: bool) -> int:
        """Return the slot into which the next map is loaded.

        Args:
            replaces: the map replaces the newest one, because it is the same map in another style.
        """
        # A map that was loaded but never shown is replaced as well.
        self._replaces = replaces and (self._loading is None or self._replaces)
        if self._loading is None:
            self._loading = next(slot for slot in count() if slot not in self.shown)
        return self._loading

    def turn(self, history: int) -> set[int]:
        """Show the loaded map and at most `history` maps; return the slots that became free."""
        before = {*self.shown}
        if self._loading is not None:
            if self._replaces:
                del self.shown[-1:]
            self.shown.append(self._loading)
            self._loading = None
        del self.shown[:-history]
        return before - {*self.shown}
