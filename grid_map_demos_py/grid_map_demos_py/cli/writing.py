# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Maps to files of any format, which are written atomically."""

import argparse
import shutil
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from grid_map_core_py import GridMap
from grid_map_core_py.files import save_images, save_npz

from .errors import CommandError, UsageError
from .formats import STANDARD, Format, check_free, format_of_destination, format_of_source
from .output import message

if TYPE_CHECKING:
    from grid_map_ros_py.bags import BagReader, BagRecord

TimedMap: TypeAlias = tuple[int | None, GridMap]
"""A map, and when it was recorded [ns] where that is known."""


class Destination:
    """Where maps go, as the arguments of `arguments.add_destination` say.

    Args:
        options: those arguments.

    Raises:
        CommandError: there is something already, or it cannot be told what to write.
    """

    def __init__(self, options: argparse.Namespace) -> None:
        self.path: str = options.destination
        self.format = format_of_destination(self.path, options.to)
        self._options = options
        if self.format is Format.IMAGES and Path(self.path).suffix == ".yaml":
            self.path = str(Path(self.path).parent)
        if self.path == STANDARD and self.format is not Format.NPZ:
            raise UsageError(f"standard output takes npz, not {self.format.value}")
        if self.path == STANDARD and (sys.stdout is None or sys.stdout.isatty()):
            raise CommandError("expected a pipe or a file at standard output, for an .npz file")
        self._check("--bits", options.bits, Format.IMAGES)
        self._check("--crs", options.crs, Format.GEOTIFF)
        self._check("--output-topic", options.output_topic, Format.BAG)
        check_free(self.path, force=options.force)

    def records(self, reader: "BagReader", index: int | None) -> "Sequence[BagRecord] | BagReader":
        """Return the records of a bag to write: all, or a single one if there is room for one only.

        Args:
            reader: the bag.
            index: index of the record that is asked for; None means all, or the last one.

        Raises:
            CommandError: the bag would be written in its own place.
            BagError: there is no such record.
        """
        if self.format is not Format.BAG:
            return [reader[-1 if index is None else index]]
        bag = Path(self._options.source).resolve()
        if Path(self.path).resolve() in (bag, bag.parent):
            raise CommandError(f"{self.path}: is the source, too; its other topics would be lost")
        return reader if index is None else [reader[index]]

    def write(self, maps: Iterable[TimedMap], topic: str) -> int:
        """Write maps, and return how many there were.

        Args:
            maps: each is written before the next is asked for.
            topic: topic of the maps in a bag, unless the options name one.

        Raises:
            CommandError, GridMapError, OSError: they cannot be written.
        """
        if self.format is Format.BAG:
            return self._write_bag(maps, self._options.output_topic or topic)
        count = 0
        for _, grid_map in maps:
            self._write_one(grid_map)
            count += 1
        if not count:
            raise CommandError(f"{self.path}: there is no map to write")
        return count

    def tell(self, count: int) -> None:
        """Say how many maps there are now; a pipe needs to be told nothing."""
        if self.path != STANDARD:
            message(f"{count} {'map' if count == 1 else 'maps'} in {self.path}")

    def _write_bag(self, maps: Iterable[TimedMap], topic: str) -> int:
        from grid_map_ros_py.bags import BagWriter

        count = 0
        compression = "zstd" if self._options.compress else "none"
        force = self._options.force
        with BagWriter(self.path, overwrite=force, compression=compression) as bag:
            for time, grid_map in maps:
                bag.write(topic, grid_map, time=time)
                count += 1
                del grid_map
        return count

    def _check(self, name: str, value: object, only_for: Format) -> None:
        if value and self.format is not only_for:
            raise UsageError(f"{name} is for {only_for.value}, and this is {self.format.value}")

    def _write_one(self, grid_map: GridMap) -> None:
        if self.format is Format.IMAGES:
            save_images(grid_map, self.path, bits=self._options.bits or 16)
        elif self.format is Format.GEOTIFF:
            self._write_geotiff(grid_map)
        elif self.path == STANDARD:
            _write_to_standard_output(grid_map, compress=self._options.compress)
        else:
            save_npz(grid_map, self.path, compress=self._options.compress)

    def _write_geotiff(self, grid_map: GridMap) -> None:
        from .geotiff import crs_of, write_geotiff

        crs, source = self._options.crs, self._options.source
        if not crs and format_of_source(source) is Format.GEOTIFF:
            crs = crs_of(source)
        write_geotiff(grid_map, self.path, crs=crs, compress=self._options.compress)


def _write_to_standard_output(grid_map: GridMap, *, compress: bool) -> None:
    # An archive is not written from its beginning to its end.
    with tempfile.TemporaryDirectory(prefix="grid-map-") as folder:
        path = Path(folder, "map.npz")
        save_npz(grid_map, path, compress=compress)
        with path.open("rb") as file:
            shutil.copyfileobj(file, sys.stdout.buffer)
