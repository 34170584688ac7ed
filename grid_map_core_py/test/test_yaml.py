# SPDX-License-Identifier: BSD-3-Clause
"""The loader of all YAML files."""

import pytest

from grid_map_core_py._files import parse_yaml
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files import load_yaml

WRONG = {
    "date": ("when: 2024-13-45", "month must be"),
    "no int": ("n: !!int ''", ""),
    "object": ("!!python/object/apply:os.system [ls]", "could not determine a constructor"),
    "repeated key": ("a: 1\nb: 2\na: 3\n", "'a' occurs twice .* line 3"),
    "repeated key below": ("a: {b: 1, c: [1], b: 2}", "'b' occurs twice"),
    "no YAML": ("a: [", ""),
    "unknown alias": ("a: *b", "undefined alias"),
    "levels": ("[" * 9999, "recursion"),
    "two documents": ("a: 1\n---\na: 2\n", "expected a single document"),
    "no text": (b"a: \xff", ""),
}


@pytest.mark.parametrize(("text", "message"), WRONG.values(), ids=WRONG)
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
