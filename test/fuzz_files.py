# SPDX-License-Identifier: BSD-3-Clause
"""Input for `fuzz.py`: bags, maps, images, chains, command lines."""

import contextlib
import io
import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from bags import DATA, TOPIC, numbered_map, write_bag, write_mcap

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Layer
from grid_map_core_py._commands import main
from grid_map_core_py._parameters import nested, node_sections
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files import (
    load_geotiff,
    load_height_image,
    load_map_server,
    load_npz,
    load_yaml,
    save_geotiff,
    save_height_image,
    save_map_server,
    save_npz,
)
from grid_map_core_py.plugins import check
from grid_map_filters_py import FilterChain
from grid_map_filters_py.expression import Expression
from grid_map_ros_py import bag_maps, save_to_bag
from grid_map_visualization_py import create

ROOT = Path(__file__).parents[1]
PARAMETERS = ROOT / "grid_map_visualization_py/config/grid_map_visualization.yaml"
CHAIN = ROOT / "grid_map_demos_py/config/filters_demo_filter_chain.yaml"

LAYERS = (
    *("elevation", "filled", "mean", "slope", "roughness", "step_height", "color", "tint"),
    *(f"{prefix}_{axis}" for prefix in ("normal", "normal_vectors") for axis in "xyz"),
)
"""Layers that the chains of the documentation need."""

COMMANDS = (
    b"info\nFalse.npz",
    b"info\n--json\nzstd/zstd_0.mcap",
    b"inspect\nFalse.npz\n--bins\n8\n--layer\nelevation",
    b"info\n--topic\n/grid_map\ndatabase",
)
EXPRESSIONS = (
    b"0.5 * (1.0 - (slope / 0.6)) + abs(elevation - mean) .^ 2",
    b"sqrt(sumOfFinites(square(slope - meanOfFinites(slope))) ./ numberOfFinites(slope))",
)
SETTINGS = b"""filter1.name=mean
filter1.type=gridMapFilters/MeanInRadiusFilter
filter1.params.input_layer=elevation
filter1.params.output_layer=mean
filter1.params.radius=0.06
filter2.name=delete
filter2.type=gridMapFilters/DeletionFilter
filter2.params.layers=color,tint,"""
"""Parameters of the node `filter_chain`."""

WINDOW_EXPRESSIONS = (
    b"sumOfFinites([0, -1, 0; -1, 5, -1; 0, -1, 0] .* elevation)",
    b"maxOfFinites(elevation) - minOfFinites(elevation)",
)


def targets(folder: Path) -> list[tuple[str, Sequence[bytes], Callable[[bytes], Any]]]:
    """Return names, intact files as bytes, and functions that read such bytes as a file.

    Args:
        folder: folder of all files.
    """
    _write(folder)
    values = np.linspace(0, 1, 35, dtype=np.float32).reshape(7, 5)
    world = GridMap((0.7, 0.5), 0.1, layers=dict.fromkeys(LAYERS, values))
    pages = "".join(page.read_text() for page in sorted((ROOT / "docs/filters").glob("*.md")))
    documented = re.findall(r"^```yaml\n(.*?)^```", pages, re.DOTALL | re.MULTILINE)
    chains = [CHAIN.read_bytes(), *(block.encode() for block in documented)]
    readers: list[tuple[str, str, str, Callable[[Path], Any]]] = [
        ("MCAP", "*/*.mcap", "damaged", _maps),
        ("MCAP recovered", "*/*.mcap", "damaged", partial(_maps, recover=True)),
        ("sqlite3", "*/*.db3", "damaged", _maps),
        ("metadata.yaml", "none/*.yaml", "none/metadata.yaml", lambda file: _maps(file.parent)),
        ("npz", "*.npz", "damaged", load_npz),
        ("nav2 map.yaml", "nav2.yaml", "nav2.yaml", load_map_server),
        ("PGM", "nav2.pgm", "nav2.pgm", lambda file: load_map_server(file.with_suffix(".yaml"))),
        ("height image", "height.*", "damaged", partial(load_height_image, resolution=0.1)),
        ("GeoTIFF", "*.tif", "damaged.tif", load_geotiff),
    ]
    texts: list[tuple[str, Sequence[bytes], Callable[[Path], Any]]] = [
        ("filter chain", chains, partial(_filtered, world)),
        ("settings of filter_chain", [SETTINGS], partial(_set, world)),
        ("visualizations", [PARAMETERS.read_bytes()], partial(_visualized, world)),
        ("expression", EXPRESSIONS, lambda file: Expression(_text(file))(world)),
        ("expression of windows", WINDOW_EXPRESSIONS, partial(_over_windows, values)),
        ("command line", COMMANDS, _run),
    ]
    found = [
        (name, [file.read_bytes() for file in sorted(folder.glob(pattern))], damaged, read)
        for name, pattern, damaged, read in readers
    ]
    return [
        *((name, seeds, _naming(folder / damaged, read)) for name, seeds, damaged, read in found),
        *((name, seeds, _through(folder / "damaged", read)) for name, seeds, read in texts),
    ]


def _write(folder: Path) -> None:
    """Write intact files of all formats."""
    for index, options in enumerate(({}, {"use_chunking": False}, {"enable_crcs": False})):
        (folder / str(index)).mkdir()
        write_mcap(folder / f"{index}/{index}.mcap", [1, 2], **options)
    for compression in ("none", "lz4", "zstd"):
        save_to_bag(numbered_map(1), folder / compression, TOPIC, compression=compression)
    write_bag(folder / "database", [1, 2], "sqlite3")
    for bag in ("cpp_tutorial_outputs.mcap", "cpp_move_sqlite/cpp_move_sqlite_0.db3"):
        path = folder / "cpp" / Path(bag).name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes((DATA / bag).read_bytes())
    for compress in (False, True):
        save_npz(numbered_map(1), folder / f"{compress}.npz", compress=compress)
        save_geotiff(numbered_map(1), folder / f"{compress}.tif", compress=compress)
    values = np.linspace(0, 1, 20, dtype=np.float32).reshape(4, 5)
    grid_map = GridMap((0.4, 0.5), 0.1, layers={"elevation": values})
    save_map_server(grid_map, folder / "nav2.yaml")
    save_height_image(grid_map, folder / "height.tiff")
    for ending in ("bmp", "pgm"):
        cv2.imwrite(str(folder / f"height.{ending}"), (255 * values).astype(np.uint8))
    values[0, 0] = np.nan
    grid_map["elevation"] = values
    save_height_image(grid_map, folder / "height.png")


def _maps(file: Path, *, recover: bool = False) -> tuple[GridMap, ...]:
    return tuple(bag_maps(file, TOPIC, recover=recover))


def _filtered(world: GridMap, file: Path) -> GridMap:
    return FilterChain.from_yaml(file)(world, warnings=[])


def _set(world: GridMap, file: Path) -> GridMap:
    """Make a chain from names and values, as the service `set_parameters` passes them."""
    pairs = (line.partition("=") for line in _text(file).split("\n"))
    return FilterChain.from_config(nested({name: _value(text) for name, _, text in pairs}))(
        world, warnings=[]
    )


def _value(text: str) -> Any:
    if text.endswith(","):
        return [_value(part) for part in text[:-1].split(",")]
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return {"true": True, "null": None}.get(text, text)


def _visualized(world: GridMap, file: Path) -> tuple[Any, ...]:
    content = load_yaml(file)
    check(isinstance(content, dict), str(file), "a mapping", content)
    sections = (
        section for _, parameters in node_sections(content) for section in parameters.items()
    )
    return tuple(
        create(name, config)(world) for name, config in sections if isinstance(config, dict)
    )


def _over_windows(layer: Layer, file: Path) -> Layer:
    return Expression(_text(file)).over_windows("elevation", layer, 3, "empty")


def _text(file: Path) -> str:
    return file.read_text(errors="surrogateescape")


def _run(file: Path) -> None:
    """Run a command line in the folder of the files; it may say that it is wrong, in one line."""
    words, errors = _text(file).split("\n"), io.StringIO()
    with (
        contextlib.chdir(file.parent),
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(errors),
    ):
        try:
            code = main(words)
        except SystemExit as end:
            code = end.code
    if code:
        assert code in (1, 2), code
        raise GridMapError(f"{file}: {errors.getvalue()}")


def _through(file: Path, read: Callable[[Path], Any]) -> Callable[[bytes], Any]:
    """Return a function that writes bytes to a file, reads it, and restores it."""
    intact = file.read_bytes() if file.exists() else b""

    def write_and_read(data: bytes) -> Any:
        file.write_bytes(data)
        try:
            return read(file)
        finally:
            file.write_bytes(intact)

    return write_and_read


def _naming(file: Path, read: Callable[[Path], Any]) -> Callable[[bytes], Any]:
    """Return a function that writes bytes to a file and reads it.

    Its errors name a file in the same folder, or begin with the path of another one.
    """

    write_and_read = _through(file, read)

    def check_error(data: bytes) -> Any:
        try:
            return write_and_read(data)
        except GridMapError as error:
            if str(file.parent) not in str(error) and not str(error).startswith("/"):
                raise AssertionError(f"no file is named in: {error}") from error
            raise

    return check_error
