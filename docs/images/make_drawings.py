# SPDX-License-Identifier: BSD-3-Clause
"""Draw the figures of the page on conventions.

    python3 docs/images/make_drawings.py [FOLDER]

writes one SVG per figure into the folder, `docs/images/conventions` by default. The content
and the place of each cell come from real maps. As on the page, x points up and y to the left.
"""

import math
import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

from grid_map_core_py import GridMap

FOLDER = Path(__file__).parent / "conventions"
PAPER, INK, FAINT, OLD, NEW, FIRST, AXIS = (
    *("#ffffff", "#1f2933", "#9aa5b1", "#cfe3f7", "#fbe3c8", "#5aa469", "#c0392b"),
)
"""A paper of its own keeps a figure readable on light and on dark pages."""

Point = tuple[float, float]

BEFORE, AFTER = (2.5, 2.0), (3.5, 3.0)
"""Positions of the map that moves."""


class Figure:
    """An SVG of a width and a height [px]; places are right and down from its upper left corner."""

    def __init__(self, width: float, height: float) -> None:
        box = {
            "viewBox": f"0 0 {width:g} {height:g}",
            "width": f"{width:g}",
            "height": f"{height:g}",
        }
        font = {"font-family": "Helvetica, Arial, sans-serif", "font-size": "13"}
        self._root = ElementTree.Element(
            "svg", {"xmlns": "http://www.w3.org/2000/svg"} | box | font
        )
        self.rectangle((0.5, 0.5), (width - 1, height - 1), fill=PAPER, stroke=FAINT, rx="6")

    def _add(self, tag: str, text: str = "", **attributes: str) -> None:
        named = {name.replace("_", "-"): value for name, value in attributes.items()}
        ElementTree.SubElement(self._root, tag, named).text = text or None

    def rectangle(self, corner: Point, size: Point, **style: str) -> None:
        x, y, width, height = (f"{value:g}" for value in (*corner, *size))
        self._add("rect", x=x, y=y, width=width, height=height, **style)

    def text(self, place: Point, words: str, **style: str) -> None:
        """Write text centered at a place."""
        x, y = (f"{value:g}" for value in place)
        middle = {"text_anchor": "middle", "dominant_baseline": "central", "fill": INK}
        self._add("text", words, x=x, y=y, **(middle | style))

    def arrow(self, start: Point, end: Point, color: str = INK) -> None:
        angle = math.atan2(end[1] - start[1], end[0] - start[0])
        wings = [
            (end[0] - 9 * math.cos(angle + turn), end[1] - 9 * math.sin(angle + turn))
            for turn in (0.4, -0.4)
        ]
        self.line(start, end, stroke=color, stroke_width="2")
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in (end, *wings))
        self._add("polygon", points=points, fill=color)

    def line(self, start: Point, end: Point, **style: str) -> None:
        x1, y1, x2, y2 = (f"{value:g}" for value in (*start, *end))
        self._add("line", x1=x1, y1=y1, x2=x2, y2=y2, **style)

    def dot(self, place: Point, color: str) -> None:
        self._add("circle", cx=f"{place[0]:g}", cy=f"{place[1]:g}", r="4", fill=color)

    def write(self, path: Path) -> None:
        ElementTree.indent(self._root)
        path.write_text(ElementTree.tostring(self._root, encoding="unicode") + "\n")


class View:
    """The world seen from above: x up, y to the left, the origin at a place of the figure."""

    def __init__(self, figure: Figure, origin: Point, scale: float) -> None:
        self.figure, self.origin, self.scale = figure, origin, scale

    def place(self, position: Point) -> Point:
        return (
            round(self.origin[0] - self.scale * position[1], 3),
            round(self.origin[1] - self.scale * position[0], 3),
        )

    def cells(self, grid_map: GridMap, words: Callable[[tuple[int, int]], tuple[str, str]]) -> None:
        """Draw the cells of a map at their positions, with a word and a color for each index."""
        side = self.scale * grid_map.resolution
        for index in ((i, j) for i in range(grid_map.size[0]) for j in range(grid_map.size[1])):
            x, y = self.place(grid_map.get_position(index))
            word, color = words(index)
            corner = (round(x - side / 2, 3), round(y - side / 2, 3))
            self.figure.rectangle(corner, (side, side), fill=color, stroke=INK)
            above, _, below = word.partition("\n")
            self.figure.text((x, y - (7 if below else 0)), above)
            if below:
                self.figure.text((x, y + 9), below, font_size="11")

    def axes(self, length: float) -> None:
        """Draw the axes of the frame."""
        for axis, name, shift in (((length, 0.0), "x", (14, 0)), ((0.0, length), "y", (0, -14))):
            x, y = self.place(axis)
            self.figure.arrow(self.origin, (x, y), AXIS)
            self.figure.text((x + shift[0], y + shift[1]), name, fill=AXIS)
        self.figure.dot(self.origin, AXIS)


def letters(grid_map: GridMap) -> Callable[[tuple[int, int]], tuple[str, str]]:
    """Return a function that gives the text and color of a cell: its letter, or "NaN"."""

    def shown(index: tuple[int, int]) -> tuple[str, str]:
        value = grid_map["data"][index]
        return ("NaN", NEW) if math.isnan(value) else (chr(int(value)), OLD)

    return shown


def lettered(rows: int = 4, columns: int = 3) -> GridMap:
    """Return a map whose cells hold A, B, C, ... row after row."""
    grid_map = GridMap((rows, columns), 1.0, BEFORE, layers=["data"])
    for number in range(rows * columns):
        grid_map["data"][divmod(number, columns)] = ord("A") + number
    return grid_map


def axes() -> Figure:
    """Draw how cells are numbered."""
    figure = Figure(470, 330)
    view = View(figure, (405, 285), 45.0)
    grid_map = GridMap((5.0, 4.0), 1.0, position=(3.0, 4.5))
    corners = {(0, 0): FIRST}
    view.cells(grid_map, lambda index: (f"{index[0]}, {index[1]}", corners.get(index, OLD)))
    view.axes(1.6)
    center = view.place(grid_map.position)
    figure.line(center, (center[0] + 104, center[1]), stroke=AXIS, stroke_dasharray="2 3")
    figure.dot(center, AXIS)
    figure.text((center[0] + 134, center[1]), "position", fill=AXIS)
    left, top = view.place(grid_map.position + grid_map.length / 2)
    right, bottom = view.place(grid_map.position - grid_map.length / 2)
    figure.arrow((left, top - 14), (right, top - 14))
    figure.text(((left + right) / 2, top - 26), "columns, length[1]")
    figure.arrow((left - 14, top), (left - 14, bottom))
    turn = f"rotate(-90 {left - 28:g} {(top + bottom) / 2:g})"
    figure.text((left - 28, (top + bottom) / 2), "rows, length[0]", transform=turn)
    x, y = view.place(grid_map.get_position((0, grid_map.size[1] - 1)))
    figure.text((x + 78, y), "resolution", text_anchor="middle")
    figure.line((x + 30, y - 22.5), (x + 30, y + 22.5), stroke=INK, stroke_width="2")
    figure.text((view.origin[0] + 4, view.origin[1] + 20), "frame_id")
    return figure


def move() -> Figure:
    """Draw the two ways to change the place of a map."""
    figure = Figure(690, 270)
    before, moved, shifted = lettered(), lettered(), lettered()
    moved.move(AFTER)
    shifted.position = AFTER
    titles = ("before", "move", "setting position")
    dashes = {"fill": "none", "stroke": FAINT, "stroke_width": "2", "stroke_dasharray": "5 4"}
    for number, (title, grid_map) in enumerate(zip(titles, (before, moved, shifted), strict=True)):
        view = View(figure, (200 + 225 * number, 250), 36.0)
        figure.rectangle(view.place(before.position + before.length / 2), (108, 144), **dashes)
        view.cells(grid_map, letters(grid_map))
        view.axes(0.9)
        figure.text((view.origin[0] - 80, 20), title, font_weight="bold")
    return figure


def buffer() -> Figure:
    """Draw where the cells of a map that has moved are stored."""
    figure = Figure(560, 310)
    grid_map = lettered()
    grid_map.move(AFTER)
    side, left, top = 42.0, 60.0, 80.0
    start = grid_map.start_index

    def color(index: tuple[int, int], otherwise: str) -> str:
        return FIRST if index == start else otherwise

    shown = letters(grid_map)
    for index in ((i, j) for i in range(grid_map.size[0]) for j in range(grid_map.size[1])):
        row, column = index
        corner = (left + side * column, top + side * row)
        word, fill = shown(index)
        figure.rectangle(corner, (side, side), fill=color(index, fill), stroke=INK)
        figure.text((corner[0] + side / 2, corner[1] + side / 2), word)
        if column == 0:
            figure.text((left - 14, corner[1] + side / 2), str(row))
        if row == 0:
            figure.text((corner[0] + side / 2, top - 14), str(column))
    figure.text((left + 1.5 * side, 24), 'stored: grid_map["data"]', font_weight="bold")
    figure.text((left + 1.5 * side, 278), f"start_index = {start}", fill=FIRST, font_weight="bold")

    def both(index: tuple[int, int]) -> tuple[str, str]:
        word, fill = shown(index)
        return f"{word}\n{index[0]}, {index[1]}", color(index, fill)

    view = View(figure, (500, 285), side)
    view.cells(grid_map, both)
    view.axes(0.9)
    figure.text((400, 24), "seen from above, with the indices", font_weight="bold")
    return figure


FIGURES = {"axes": axes, "move": move, "buffer": buffer}


def main(folder: Path) -> None:
    """Write all figures."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in FIGURES.items():
        draw().write(folder / f"{name}.svg")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
