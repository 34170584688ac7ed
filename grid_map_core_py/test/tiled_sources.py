# SPDX-License-Identifier: BSD-3-Clause
"""A source of computed layers whose tiles wait, fail, or kill their process when a test says so."""

import os
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from grid_map_core_py.errors import GridMapError
from grid_map_core_py.map import GridGeometry
from grid_map_core_py.tiled import TiledMap
from grid_map_core_py.tiled._source import Window


@dataclass(frozen=True)
class Waves:
    """Waves over all cells.

    Args:
        folder: each tile that is computed adds its first cell to the file `log` there. The files
            `kill`, `fail` and `wait` hold the first cell of a tile: its process is killed, once; it
            raises an error; it waits until the file `wait` is gone.
        layers: names of the layers.
    """

    folder: str
    layers: tuple[str, ...] = ("elevation", "variance")

    def describe(self) -> str:
        return "waves"

    def prepare(self) -> None:
        """Do nothing."""

    def read(self, window: Window, names: Sequence[str]) -> list[np.ndarray]:
        rows, columns = (np.arange(part.start, part.stop) for part in window)
        self._behave(f"{rows[0]} {columns[0]}")
        waves = np.sin(0.1 * rows)[:, None] * np.cos(0.07 * columns)
        waves[waves > 0.9] = np.nan
        number = {name: number for number, name in enumerate(self.layers, 1)}
        return [np.array(number[name] * waves, np.float32, order="F") for name in names]

    def _behave(self, cell: str) -> None:
        folder = Path(self.folder)
        with (folder / "log").open("a") as log:
            log.write(f"{cell}\n")
        if told(folder / "kill") == cell:
            (folder / "kill").unlink()
            os.kill(os.getpid(), signal.SIGKILL)
        if told(folder / "fail") == cell:
            raise GridMapError("there are no waves")
        while told(folder / "wait") == cell:
            time.sleep(0.01)

    def computed(self) -> list[str]:
        """Return the first cells of the tiles that were computed, and forget them."""
        log = Path(self.folder, "log")
        lines = log.read_text().split("\n")[:-1]
        log.unlink()
        return lines


def told(file: Path) -> str:
    try:
        return file.read_text()
    except FileNotFoundError:
        return ""


def waves(folder: Path, size: tuple[int, int] = (100, 70), tile: int = 16) -> TiledMap:
    """Return a tiled map of 35 tiles; `folder` is that of `Waves`."""
    return TiledMap(Waves(str(folder)), GridGeometry.from_size(size, 0.1), (tile, tile))


if __name__ == "__main__":
    from dask import config

    def interrupt(*_: object) -> None:
        Path(sys.argv[1], "interrupted").touch()
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    config.set(num_workers=2)
    waves(Path(sys.argv[1])).to_zarr(sys.argv[2], resume="--resume" in sys.argv)
