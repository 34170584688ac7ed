# SPDX-License-Identifier: BSD-3-Clause
"""Maps in `.npz` files, and YAML files."""

import io
import json
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from command_line import SECOND, a_map
from hypothesis import given, strategies as st

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files import load_npz, save_npz
from grid_map_core_py.files._shared import load_yaml, parse_yaml
from grid_map_core_py.testing import assert_maps_equal, grid_maps

NAMES = st.text(st.characters(exclude_categories=["Cc", "Cs"]), min_size=1)


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "map.npz"


# --- round trips ----------------------------------------------------------------------------------


@given(grid_maps(("elevation", "variance")), st.booleans())
def test_map_round_trips_exactly_in_map_order(grid_map, compress):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map"
        save_npz(grid_map, path, compress=compress)
        loaded = load_npz(path)
    assert loaded.start_index == (0, 0)
    assert loaded.resolution == grid_map.resolution
    assert loaded.position.tolist() == grid_map.position.tolist()
    assert_maps_equal(loaded, grid_map)
    for layer in grid_map:
        assert loaded[layer].tobytes() == grid_map.unwrapped(layer).tobytes()
        assert loaded[layer].flags.f_contiguous


@given(st.lists(NAMES, unique=True, max_size=4), NAMES)
def test_any_name_round_trips(names, frame_id):
    grid_map = GridMap((1, 1), 0.5, layers=dict.fromkeys(names, 1.0), frame_id=frame_id)
    with tempfile.TemporaryDirectory() as folder:
        save_npz(grid_map, f"{folder}/map.npz")
        assert_maps_equal(load_npz(f"{folder}/map.npz"), grid_map)


def test_numpy_alone_can_read_it(path):
    save_npz(a_map(), path)
    with np.load(path) as file:
        np.testing.assert_array_equal(file["layers/elevation"], a_map().unwrapped("elevation"))
        metadata = json.loads(str(file["metadata"]))
    assert (metadata["size"], metadata["timestamp"]) == ([8, 6], 3 * SECOND)


# --- damaged files --------------------------------------------------------------------------------


def npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def rewritten(path: Path, contents: dict[str, bytes], **metadata: object) -> Path:
    """Write a map with other members of the archive, or other metadata."""
    save_npz(a_map(), path)
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    found = json.loads(str(np.load(io.BytesIO(members["metadata.npy"]))))
    members["metadata.npy"] = npy(np.array(json.dumps(found | metadata)))
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in (members | contents).items():
            archive.writestr(name, content)
    return path


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"format": "other"}, "expected format 'grid_map' of version 1, got 'other' 1"),
        ({"size": [10**3, 10**3]}, "8, 6"),
        ({"resolution": -1.0}, "resolution"),
        ({"layers": ["slope"]}, "slope.npy"),
        ({"frame_id": "\x1b[2J"}, "frame_id: expected a string without control characters"),
        ({"timestamp": "now"}, "timestamp"),
    ],
)
def test_invalid_metadata_is_refused(path, changes, reason):
    with pytest.raises(GridMapError, match=rf"map\.npz: .*{reason}"):
        load_npz(rewritten(path, {}, **changes))


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("metadata.npy", npy(np.zeros(3)), ""),
        ("layers/elevation.npy", npy(np.zeros((3, 4), np.float32)), "3, 4"),
        ("layers/elevation.npy", npy(np.array([print], dtype=object)), "allow_pickle"),
        ("layers/elevation.npy", b"no array", "magic"),
    ],
    ids=range(4),
)
def test_invalid_arrays_are_refused(path, name, content, reason):
    with pytest.raises(GridMapError, match=f"(?s){path}: .*{reason}"):
        load_npz(rewritten(path, {name: content}))


def test_a_file_of_something_else_is_refused(path):
    np.savez(path, a=np.zeros(3))
    with pytest.raises(GridMapError, match="no file of a map: 'metadata' is missing"):
        load_npz(path)
    path.write_bytes(b"PK no archive")
    with pytest.raises(GridMapError, match="not a zip file"):
        load_npz(path)


# --- YAML -----------------------------------------------------------------------------------------


WRONG_YAML = {
    "no int": ("n: !!int ''", ""),
    "object": ("!!python/object/apply:os.system [ls]", "could not determine a constructor"),
    "repeated key": ("a: 1\nb: 2\na: 3\n", "'a' occurs twice .* line 3"),
    "levels": ("[" * 9999, "recursion"),
    "no text": (b"a: \xff", ""),
}


@pytest.mark.parametrize(("text", "message"), WRONG_YAML.values(), ids=WRONG_YAML)
def test_invalid_files_are_one_error_that_names_them(tmp_path, text, message):
    path = tmp_path / "file.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(GridMapError, match=rf"^{path}: no valid YAML: .*{message}"):
        load_yaml(path)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(GridMapError, match=r"nowhere\.yaml: cannot be read: No such file"):
        load_yaml(tmp_path / "nowhere.yaml")


def test_aliases_merge_keys_and_short_numbers_are_read():
    text = "a: &a {x: 1e-3, y: .5e2}\nb: {<<: *a, y: 2}\nc: [*a, *a]\nd: [1, 1.5, 2e3x, 0x10]\n"
    a = {"x": 0.001, "y": 50.0}
    expected = {"a": a, "b": {"x": 0.001, "y": 2}, "c": [a, a], "d": [1, 1.5, "2e3x", 16]}
    assert parse_yaml(text, "text") == expected
    assert parse_yaml("", "text") is None
