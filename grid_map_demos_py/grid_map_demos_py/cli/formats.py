# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Which format a file has, by its name."""

import os
from enum import Enum
from pathlib import Path

from .errors import CommandError, UsageError

STANDARD = "-"
"""Names standard input or output, which are of the format NPZ."""


class Format(Enum):
    """Of a file that holds maps, or what maps are made of."""

    BAG = "bag"
    NPZ = "npz"
    IMAGES = "images"
    GEOTIFF = "geotiff"
    CLOUD = "cloud"


WRITABLE = (Format.BAG, Format.NPZ, Format.IMAGES, Format.GEOTIFF)

IMAGES_NAME = "map.yaml"

_OF_ENDING = {
    ".npz": Format.NPZ,
    ".mcap": Format.BAG,
    ".db3": Format.BAG,
    ".yaml": Format.IMAGES,
    ".tif": Format.GEOTIFF,
    ".tiff": Format.GEOTIFF,
    ".pcd": Format.CLOUD,
    ".ply": Format.CLOUD,
    ".obj": Format.CLOUD,
    ".stl": Format.CLOUD,
}


def format_of_source(path: str) -> Format:
    """Return the format of what is to be read.

    Raises:
        CommandError: it is none that is known.
    """
    file = Path(path)
    if path == STANDARD:
        return Format.NPZ
    if file.is_dir():
        is_bag = (file / "metadata.yaml").exists() or not (file / IMAGES_NAME).exists()
        return Format.BAG if is_bag else Format.IMAGES
    found = _OF_ENDING.get(file.suffix.lower())
    if found:
        return found
    if file.exists():
        known = ", ".join(_OF_ENDING)
        raise CommandError(f"{path}: expected the folder of a bag, or a file that ends in {known}")
    # A bag may be put aside for an instant; its reader knows.
    return Format.BAG


def format_of_destination(path: str, wanted: str | None) -> Format:
    """Return the format of what is to be written, which the name tells unless it is `wanted`.

    Raises:
        UsageError: the name tells none.
    """
    if wanted:
        return Format(wanted)
    if path == STANDARD:
        return Format.NPZ
    file = Path(path)
    found = _OF_ENDING.get(file.suffix.lower())
    if found in (Format.NPZ, Format.GEOTIFF):
        return found
    if file.name == IMAGES_NAME:
        return Format.IMAGES
    if not file.suffix:
        return Format.BAG
    if found is Format.BAG:
        raise UsageError(f"{path}: a bag is a folder, leave out the {file.suffix}")
    if found is Format.IMAGES:
        raise UsageError(f"{path}: images go to a folder: FOLDER/{IMAGES_NAME}, or --to images")
    raise UsageError(
        f"{path}: expected a name that ends in .npz, .tif or /{IMAGES_NAME}, or one without ending "
        "for a bag; --to says it otherwise"
    )


def check_free(path: str, *, force: bool) -> None:
    """Refuse to replace what is there.

    Raises:
        CommandError: there is something, and it was not said to replace it, or it is a device, a
            pipe or a socket.
    """
    if path == STANDARD or not os.path.lexists(path):
        return
    file = Path(path)
    if file.exists() and not (file.is_file() or file.is_dir()):
        raise CommandError(f"{path}: is neither a file nor a folder, and not replaced")
    if not force:
        raise CommandError(f"{path}: is there already; --force replaces it")
