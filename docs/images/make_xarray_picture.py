# SPDX-License-Identifier: BSD-3-Clause
"""Draw the picture of the page about xarray: by the Python of the page, up to the picture.

    python3 docs/images/make_xarray_picture.py [FOLDER]

writes `terrain.png` into the folder, `docs/images/xarray` by default.
"""

import os
import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

FOLDER = Path(__file__).parent / "xarray"
PAGE = Path(__file__).parents[1] / "xarray.md"
COLORS = 128
"""A palette makes the file three times smaller."""


def main(folder: Path) -> None:
    """Draw the picture."""
    text = PAGE.read_text().partition("![")[0]
    code = "".join(re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))
    folder = folder.absolute()
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as scratch:
        os.chdir(scratch)
        exec(code, {})  # noqa: S102
        picture = Image.open("terrain.png").convert("RGB")
        os.chdir(folder)
    picture.quantize(COLORS, dither=Image.Dither.NONE).save(folder / "terrain.png", optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else FOLDER)
