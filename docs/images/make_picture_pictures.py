# SPDX-License-Identifier: BSD-3-Clause
"""Draw the pictures of the page about pictures: by the Python of the page.

    python3 docs/images/make_picture_pictures.py [FOLDER]

writes those that the page shows into the folder, `docs/images/pictures` by default.
"""

import os
import re
import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

FOLDER = Path(__file__).parent / "pictures"
PAGE = Path(__file__).parents[1] / "pictures.md"
COLORS = 256
"""A palette makes a file three times smaller."""


def main(folder: Path) -> None:
    """Draw the pictures."""
    text = PAGE.read_text()
    code = "".join(re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))
    names = re.findall(r"\(images/pictures/(\S+)\)", text)
    folder = folder.absolute()
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as scratch:
        os.chdir(scratch)
        exec(code, {})  # noqa: S102
        for name in names:
            if name.endswith(".gif"):
                shutil.copy(name, folder)
                continue
            picture = Image.open(name).convert("RGB")
            picture.quantize(COLORS, dither=Image.Dither.NONE).save(folder / name, optimize=True)
        os.chdir(folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else FOLDER)
