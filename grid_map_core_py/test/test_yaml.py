# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The one loader of all YAML files."""

import time

import pytest

from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files import load_yaml, parse_yaml

LAUGHS = "a0: &a0 [x, x]\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 9)
)
MERGES = "a0: &a0 {x: 1}\n" + "".join(
    f"a{n}: &a{n} {{<<: [{', '.join([f'*a{n - 1}'] * 9)}]}}\n" for n in range(1, 9)
)

WRONG = {
    "aliases": (LAUGHS, "aliases stand for more than 100000 values"),
    "merges": (MERGES, "aliases stand for more than 100000 values"),
    "itself": ("&p {x: *p}", "the alias 'p' stands for itself"),
    "levels": ("[" * 500 + "]" * 500, "nested more than 50 times"),
    "open levels": ("[" * 500, "nested more than 50 times"),
    "date": ("when: 2024-13-45", "no valid YAML: month must be in 1..12"),
    "digits": ("n: " + "9" * 5000, "no valid YAML: Exceeds the limit"),
    "repeated key": ("a: 1\nb: 2\na: 3\n", "'a' occurs twice, again in line 3"),
    "repeated key below": ("a: {b: 1, c: [1], b: 2}", "'b' occurs twice, again in line 1"),
    "no YAML": ("a: [", "no valid YAML: "),
    "unknown alias": ("a: *b", "no valid YAML: "),
    "two documents": ("a: 1\n---\na: 2\n", "no valid YAML: "),
    "object": ("!!python/object/apply:os.system [ls]", "no valid YAML: "),
    "no text": ("a: \udcff", "no valid YAML: "),
    "size": ("x" * 5_000_000, "larger than 4194304 bytes"),
}


@pytest.mark.parametrize(("text", "message"), WRONG.values(), ids=WRONG)
def test_bombs_and_invalid_files_are_refused_at_once(tmp_path, text, message):
    path, data = tmp_path / "file.yaml", text.encode("utf-8", "surrogateescape")
    path.write_bytes(data)
    begin = time.monotonic()
    for load in (lambda: load_yaml(path), lambda: parse_yaml(data, path)):
        with pytest.raises(GridMapError) as caught:
            load()
        assert str(caught.value).startswith(f"{path}: {message}")
        assert len(str(caught.value)) < 500
    assert time.monotonic() - begin < 2


def test_missing_file_is_named(tmp_path):
    with pytest.raises(GridMapError, match=r"nowhere\.yaml: cannot be read: No such file"):
        load_yaml(tmp_path / "nowhere.yaml")


def test_aliases_merge_keys_and_short_numbers_are_read():
    text = "a: &a {x: 1e-3, y: .5e2}\nb: {<<: *a, y: 2}\nc: [*a, *a]\nd: [1, 1.5, 2e3x, 0x10]\n"
    a = {"x": 0.001, "y": 50.0}
    expected = {"a": a, "b": {"x": 0.001, "y": 2}, "c": [a, a], "d": [1, 1.5, "2e3x", 16]}
    assert parse_yaml(text, "text") == expected
    assert parse_yaml("", "text") is None
