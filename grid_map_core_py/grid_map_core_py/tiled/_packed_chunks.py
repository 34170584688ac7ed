# SPDX-License-Identifier: BSD-3-Clause
"""Chunks packed by Blosc whose length is checked; importing this module lets Zarr use them.

By itself numcodecs reads beyond the end of a chunk that was cut, and returns any values.
"""

from typing import Any

import numcodecs

_LENGTH = slice(12, 16)
"""Place of the packed length in a chunk [bytes], little-endian."""


class CheckedBlosc(numcodecs.Blosc):  # type: ignore[misc]
    """The codec of numcodecs, which refuses chunks that are shorter than they claim."""

    codec_id = "blosc"

    def decode(self, buf: Any, out: Any = None) -> Any:
        """Return the unpacked chunk.

        Raises:
            ValueError: the chunk is too short.
        """
        packed = memoryview(buf).cast("B")
        expected = int.from_bytes(packed[_LENGTH], "little")
        if not packed.nbytes >= max(expected, _LENGTH.stop):
            raise ValueError(f"expected {expected} packed bytes, got {packed.nbytes}")
        return super().decode(buf, out)


numcodecs.register_codec(CheckedBlosc)
