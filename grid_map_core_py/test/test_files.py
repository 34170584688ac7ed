# SPDX-License-Identifier: BSD-3-Clause
"""Point clouds and meshes from files, which are written here byte by byte."""

import struct

import numpy as np
import pytest

from grid_map_core_py import GridMapError, color_value_to_vector
from grid_map_core_py.conversions import from_mesh
from grid_map_core_py.files import load_cloud, load_mesh, load_points

# Optional under ROS, because rosdep has no key for them; `make test` installs both.
pytestmark = pytest.mark.needs("pypcd4", "trimesh")

XYZ = np.array([(0, 0, 0.5), (1, 0, 1.5), (1, 2, -2.25), (0, 2, 4)], np.float32)
INTENSITY = np.array([0.25, 1, 7, 100], np.float32)
RGB = np.array([(255, 0, 0), (1, 2, 3), (0, 0, 0), (255, 255, 255)], np.uint8)
PACKED = RGB.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
QUAD = [(0, 1, 2), (0, 2, 3)]


@pytest.fixture
def write(tmp_path):
    def write(name, *parts):
        path = tmp_path / name
        path.write_bytes(b"".join(p.encode() if isinstance(p, str) else p for p in parts))
        return path

    return write


def triangles(path) -> set[frozenset[tuple[float, ...]]]:
    """Return the corners of each triangle of a file, in no order."""
    vertices, faces = load_mesh(path)
    assert vertices.dtype == np.float64
    assert faces.dtype == np.int64
    return {frozenset(map(tuple, vertices[face].tolist())) for face in faces}


def corners(faces) -> set[frozenset[tuple[float, ...]]]:
    return {frozenset(map(tuple, XYZ[list(face)].astype(float).tolist())) for face in faces}


# PCD


def pcd_header(data: str, count: int = 4) -> str:
    return (
        "# .PCD v0.7 - Point Cloud Data file format\n"
        "VERSION 0.7\nFIELDS x y z intensity rgb\nSIZE 4 4 4 4 4\nTYPE F F F F U\n"
        f"COUNT 1 1 1 1 1\nWIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
        f"POINTS {count}\nDATA {data}\n"
    )


ROWS = list(zip(*XYZ.T.tolist(), INTENSITY.tolist(), PACKED.tolist(), strict=True))
TEXT = "".join(" ".join(map(str, row)) + "\n" for row in ROWS)
BINARY = b"".join(struct.pack("<4fI", *row) for row in ROWS)


@pytest.mark.parametrize(("form", "data"), [("ascii", TEXT), ("binary", BINARY)])
def test_a_pcd_file_gives_points_and_fields(write, form, data):
    points, fields = load_points(write("cloud.PCD", pcd_header(form), data))
    assert points.dtype == np.float32
    np.testing.assert_array_equal(points, XYZ)
    assert list(fields) == ["intensity", "rgb"]
    np.testing.assert_array_equal(fields["intensity"], INTENSITY)
    np.testing.assert_array_equal(np.rint(255 * color_value_to_vector(fields["rgb"])), RGB)


def test_a_pcd_file_of_one_point_and_of_doubles(write):
    header = (
        "VERSION .7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\n"
        "WIDTH 1\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n"
    )
    points, fields = load_points(write("one.pcd", header, "500000.125 nan 1e-3\n"))
    assert points.dtype == np.float64
    np.testing.assert_array_equal(points, [(500000.125, np.nan, 1e-3)])
    assert fields == {}


def test_padding_is_left_out_and_wide_fields_are_split(write):
    header = (
        "VERSION 0.7\nFIELDS x y z _ normal\nSIZE 4 4 4 1 4\nTYPE F F F U F\nCOUNT 1 1 1 4 2\n"
        "WIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA binary\n"
    )
    row = struct.pack("<3f4B2f", 1, 2, 3, 0, 0, 0, 0, 5, 6)
    points, fields = load_points(write("padded.pcd", header, row, row))
    assert points.tolist() == [[1, 2, 3]] * 2
    assert {name: values.tolist() for name, values in fields.items()} == {
        "normal__0000": [5, 5],
        "normal__0001": [6, 6],
    }


def test_colors_that_are_floats_lose_their_alpha_and_nan_stays(write):
    header = pcd_header("binary", 3).replace("rgb", "rgba").replace("F F F F U", "F F F F F")
    opaque, plain, missing = 0xFF0A0B0C, 0x0A0B0C, 0x7FC00000
    data = b"".join(struct.pack("<4fI", 0, 0, 0, 0, c) for c in (opaque, plain, missing))
    _, fields = load_points(write("colors.pcd", header, data))
    np.testing.assert_allclose(
        255 * color_value_to_vector(fields["rgb"]), [(10, 11, 12)] * 2 + [(np.nan,) * 3], rtol=1e-6
    )


# PLY

PLY_POINTS = (
    "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "property float intensity\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
)
PLY_ROWS = list(zip(*XYZ.T.tolist(), INTENSITY.tolist(), *RGB.T.tolist(), strict=True))
PLY_TEXT = "".join(" ".join(map(str, row)) + "\n" for row in PLY_ROWS)
PLY_BINARY = b"".join(struct.pack("<4f3B", *row) for row in PLY_ROWS)


def ply_header(form: str, faces: int = 0) -> str:
    element = f"element face {faces}\nproperty list uchar int vertex_indices\n" if faces else ""
    return f"ply\nformat {form} 1.0\ncomment by hand\n{PLY_POINTS}{element}end_header\n"


@pytest.mark.parametrize("with_faces", [False, True])
@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_a_ply_file_gives_points_fields_and_triangles(write, form, with_faces):
    vertices, faces = PLY_TEXT, "3 0 1 2\n3 0 2 3\n"
    if form != "ascii":
        vertices, faces = PLY_BINARY, b"".join(struct.pack("<B3i", 3, *face) for face in QUAD)
    path = write("a.ply", ply_header(form, 2 * with_faces), vertices, faces * with_faces)
    points, fields = load_points(path)
    assert points.dtype == np.float32
    np.testing.assert_array_equal(points, XYZ)
    np.testing.assert_array_equal(fields["intensity"], INTENSITY)
    np.testing.assert_array_equal(np.rint(255 * color_value_to_vector(fields["rgb"])), RGB)
    assert list(fields) == ["intensity", "rgb"]
    if with_faces:
        assert triangles(path) == corners(QUAD)


# OBJ


def test_obj_file_with_quads_and_objects_is_one_mesh(write):
    vertices = "".join("v " + " ".join(map(str, xyz)) + "\n" for xyz in XYZ.tolist())
    path = write(
        "m.obj",
        "# by hand\nmtllib none.mtl\no one\n",
        vertices,
        "vn 0 0 1\nvt 0 0\nusemtl a\nf 1/1/1 2/1/1 3/1/1 4/1/1\n",
        "o two\nusemtl b\nf -4//1 -3//1 -1//1\n",
    )
    quads = [QUAD, [(0, 1, 3), (1, 2, 3)]]
    assert any(triangles(path) == corners([*quad, (0, 1, 3)]) for quad in quads)
    found = {tuple(point) for point in load_points(path)[0].tolist()}
    assert found == {tuple(xyz) for xyz in XYZ.astype(float).tolist()}


# STL


STL = b"solid, though binary".ljust(80) + struct.pack("<I", 2)
STL += b"".join(struct.pack("<12fH", 0, 0, 1, *XYZ[list(face)].ravel(), 0) for face in QUAD)


def test_a_binary_stl_file_gives_triangles_and_a_map(write):
    path = write("b.STL", STL)
    assert triangles(path) == corners(QUAD)
    assert len(load_points(path)[0]) == 6
    grid_map = from_mesh(*load_mesh(path), 0.5)
    assert grid_map.size == (2, 4)
    assert np.isfinite(grid_map["elevation"]).all()


# Bad files


def loaders(name: str) -> list:
    return [load_points] if name.endswith("pcd") else [load_points, load_mesh]


@pytest.mark.parametrize("name", ["none.ply", "none.pcd", "folder.pcd"])
def test_a_missing_file_is_named(tmp_path, name):
    (tmp_path / "folder.pcd").mkdir()
    for load in loaders(name):
        with pytest.raises(GridMapError, match=f"{name}: cannot be read: (No such file|Is a dir)"):
            load(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "load"),
    [
        *((name, load) for name in ("a.xyz", "a") for load in (load_points, load_mesh)),
        ("cloud.pcd", load_mesh),
    ],
)
def test_error_of_unknown_ending_lists_known_endings(write, load, name):
    with pytest.raises(GridMapError, match=rf"{name}: .* ends in \.ply, \.obj, \.stl"):
        load(write(name, "hello"))


DAMAGED = {
    "empty.pcd": b"",
    "ascii.pcd": (pcd_header("ascii") + TEXT[: len(TEXT) // 2]).encode(),
    "binary.pcd": pcd_header("binary").encode() + BINARY[:-3],
    "no_z.pcd": (pcd_header("ascii").replace("x y z", "x y w") + TEXT).encode(),
    "none.pcd": pcd_header("binary", 0).encode(),
    "empty.ply": b"",
    "faces.ply": (ply_header("ascii", 2) + PLY_TEXT + "3 0 1 2\n").encode(),
    "mixed.ply": (ply_header("ascii", 3) + PLY_TEXT + "3 0 1 2\n4 0 1 2 3\n").encode(),
    "binary.ply": ply_header("binary_little_endian", 2).encode() + PLY_BINARY[:-5],
    "text.obj": b"hello world\n",
    "binary.stl": STL[:-7],
    "flat.obj": b"v 0 0\nv 1 0\nv 1 1\nf 1 2 3\n",
    "faces.obj": b"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 9\n",
    "vertex.ply": (ply_header("ascii", 1) + PLY_TEXT + "3 0 1 9\n").encode(),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_file_is_one_line_that_names_it(write, name):
    path = write(name, DAMAGED[name])
    for load in loaders(name):
        with pytest.raises(GridMapError, match=f"{name}: ") as caught:
            load(path)
        assert len(str(caught.value).splitlines()) == 1
        assert not name.startswith("empty") or "number of vertices" not in str(caught.value)


def test_mesh_too_large_for_a_map_is_named(write):
    path = write("far.obj", "v 0 0 0\nv 1e9 0 0\nv 0 1e9 0\nf 1 2 3\n")
    with pytest.raises(GridMapError, match=r"far\.obj: .* cells"):
        load_cloud(path, resolution=0.1)


def test_mixed_faces_of_a_binary_ply_file_are_refused(write):
    faces = struct.pack("<B3i", 3, 0, 1, 2) + struct.pack("<B4i", 4, 0, 1, 2, 3)
    path = write("mixed.ply", ply_header("binary_little_endian", 2), PLY_BINARY, faces)
    with pytest.raises(GridMapError, match="must all have the same number of vertices"):
        load_mesh(path)
