# SPDX-License-Identifier: BSD-3-Clause
"""Parser of the Markdown pages of the documentation."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from scratch import ROOT

PATTERNS = ("*.md", "docs/**/*.md", "benchmarks/*.md", "grid_map_*/*.md", "grid_map_*/data/*.md")

_BLOCK = re.compile(r"^```(\S*) ?([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
_LINK = re.compile(r"\]\(([^)\s]+)\)")
_INLINE = re.compile(r"`([^`\n]+)`")
_PROGRAM = 'if __name__ == "__main__":'


@dataclass(frozen=True)
class Block:
    """A fenced block; `info` is what follows the language on its first line."""

    page: "Page"
    line: int
    language: str
    info: str
    text: str

    @property
    def is_program(self) -> bool:
        return self.language == "python" and _PROGRAM in self.text

    @property
    def until(self) -> str:
        """Text that a program or an endless command prints once it works."""
        found = re.search(r'until="([^"]*)"', self.info)
        found = found or re.search(r"   # prints (.*)$", self.text, re.MULTILINE)
        return found[1] if found else ""

    @property
    def file(self) -> str:
        """Name of the file that the block shows; "" if it shows none."""
        found = re.search(r'file="([^"]*)"', self.info)
        return found[1] if found else ""

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


@dataclass(frozen=True)
class Page:
    """A Markdown file."""

    path: Path

    @property
    def text(self) -> str:
        return self.path.read_text(encoding="utf-8")

    @property
    def prose(self) -> str:
        """The text without fenced blocks."""
        return _BLOCK.sub("", self.text)

    @property
    def blocks(self) -> list[Block]:
        return [
            Block(self, self.text.count("\n", 0, found.start()) + 1, *found.groups())
            for found in _BLOCK.finditer(self.text)
        ]

    @property
    def links(self) -> list[str]:
        return _LINK.findall(self.prose)

    @property
    def inline_code(self) -> list[str]:
        return _INLINE.findall(self.prose)

    @property
    def anchors(self) -> set[str]:
        """Names under which links find the headings."""
        titles = (re.sub(r"[^\w\- ]", "", title.lower()) for title in _HEADING.findall(self.prose))
        return {title.strip().replace(" ", "-") for title in titles}

    def section(self, title: str) -> str:
        """Return the text under a heading, up to the next heading."""
        _, heading, rest = self.text.partition(f"# {title}\n")
        assert heading, f"{self} has no section {title!r}"
        return re.split(r"^#+ ", rest, maxsplit=1, flags=re.MULTILINE)[0]

    def __str__(self) -> str:
        return str(self.path.relative_to(ROOT))


def page(name: str) -> Page:
    return Page(ROOT / name)


def table(section: str) -> Iterator[list[str]]:
    """Yield the cells of every row of the tables in a section, without header rows."""
    for line, following in pairwise([*section.splitlines(), ""]):
        if line.startswith("|") and not f"{line}{following}".count("|---"):
            yield [cell.strip() for cell in line.strip("|").split("|")]


PAGES = [Page(path) for pattern in PATTERNS for path in sorted(ROOT.glob(pattern))]
BLOCKS = [block for each in PAGES for block in each.blocks]
