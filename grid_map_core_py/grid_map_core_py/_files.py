# SPDX-License-Identifier: BSD-3-Clause
"""File helpers shared by the packages of the suite."""

from .files._formats import (
    MapRecord as MapRecord,
    find_format as find_format,
    options_of as options_of,
)
from .files._image_files import (
    encode_image as encode_image,
    read_image as read_image,
    write_image as write_image,
)
from .files._shared import (
    map_facts as map_facts,
    new_file as new_file,
    new_folder as new_folder,
    parse_yaml as parse_yaml,
    storage_errors as storage_errors,
)

__all__ = [name for name in dir() if not name.startswith("_")]
