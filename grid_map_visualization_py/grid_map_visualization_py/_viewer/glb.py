# SPDX-License-Identifier: BSD-3-Clause
"""Convert surfaces to binary glTF (GLB), and colors to linear light and to screen colors.

Specification: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

import json
import struct
from typing import Any

import numpy as np
import numpy.typing as npt

from ..colors import Colors
from ..surface import Mesh

FLOAT, UNSIGNED_INT, UNSIGNED_SHORT = 5126, 5125, 5123
"""glTF component types."""

EXPOSURE = 1 / 0.6

TO_FILM = np.array(
    [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]]
)
FROM_FILM = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
)


def to_glb(mesh: Mesh, *, shaded: bool = True, opacity: float = 1.0) -> bytes:
    """Convert a mesh with at least one face to the content of a GLB file."""
    lower, upper = (bound(mesh.vertices, axis=0).tolist() for bound in (np.min, np.max))
    # 16 bits keep dark colors distinct. The fourth channel aligns vertices to four bytes.
    light = np.rint(0xFFFF * linear(np.arange(256, dtype=np.uint8))).astype("<u2")
    colors = np.insert(np.take(light, mesh.colors), 3, 0xFFFF, axis=1)
    arrays: list[tuple[npt.NDArray[Any], int, str, dict[str, Any]]] = [
        (mesh.vertices.astype("<f4", copy=False), FLOAT, "VEC3", {"min": lower, "max": upper}),
        (colors, UNSIGNED_SHORT, "VEC4", {"normalized": True}),
        (mesh.faces.astype("<u4", copy=False).reshape(-1), UNSIGNED_INT, "SCALAR", {}),
    ]
    blobs = [np.ascontiguousarray(values).tobytes() for values, *_ in arrays]
    ends = np.cumsum([len(blob) for blob in blobs]).tolist()
    surface = {"baseColorFactor": [1, 1, 1, opacity], "metallicFactor": 0, "roughnessFactor": 1}
    material: dict[str, Any] = {"pbrMetallicRoughness": surface, "doubleSided": True}
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "material": 0}
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "materials": [material],
        "meshes": [{"primitives": [primitive]}],
        "buffers": [{"byteLength": ends[-1]}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": end - len(blob), "byteLength": len(blob)}
            for blob, end in zip(blobs, ends, strict=True)
        ],
        "accessors": [
            {"bufferView": k, "componentType": number, "count": len(values), "type": kind, **more}
            for k, (values, number, kind, more) in enumerate(arrays)
        ],
    }
    if opacity < 1:
        material["alphaMode"] = "BLEND"
    if not shaded:
        material["extensions"] = {"KHR_materials_unlit": {}}
        document["extensionsUsed"] = ["KHR_materials_unlit"]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON"), text, struct.pack("<I4s", ends[-1], b"BIN\0")
    size = 12 + sum(map(len, chunks)) + ends[-1]
    return b"".join([struct.pack("<4sII", b"glTF", 2, size), *chunks, *blobs])


def linear(colors: Colors) -> npt.NDArray[np.float64]:
    """Convert sRGB colors (IEC 61966-2-1) to linear light in [0, 1]."""
    value = np.arange(256) / 255
    table = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return np.take(table, colors)


def on_screen(colors: Colors) -> Colors:
    """Convert the colors of a fully lit surface to the colors that appear on the screen.

    viser applies filmic tone mapping: Stephen Hill's fit of the Academy Color Encoding System,
    called `ACESFilmicToneMapping` in three.js.
    """
    film = EXPOSURE * linear(colors) @ TO_FILM.T
    film = (film * (film + 0.0245786) - 0.000090537) / (
        film * (0.983729 * film + 0.4329510) + 0.238081
    )
    light = np.clip(film @ FROM_FILM.T, 0, 1)
    bent = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    shown: Colors = np.rint(255 * bent).astype(np.uint8)
    return shown
