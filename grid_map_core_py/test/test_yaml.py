# SPDX-License-Identifier: BSD-3-Clause
"""The one loader of all YAML files."""

import json
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
    "aliases": (LAUGHS, "more than 100000 values"),
    "merges": (MERGES, "more than 100000 values"),
    "itself": ("&p {x: *p}", "the alias 'p' stands for itself"),
    "levels": ("[" * 500 + "]" * 500, "nested more than 50 times"),
    "open levels": ("[" * 500, "nested more than 50 times"),
    "values": ("[" + "0," * 2_000_000 + "]", "more than 100000 values"),
    "empty values": ("[" + "{}," * 1_300_000 + "]", "more than 100000 values"),
    "directives": (
        "".join(f"%TAG !{n}! x\n" for n in range(90_000)) + "--- 1",
        "more than 100 times %TAG",
    ),
    "long tags": (
        f"%TAG !e! {'a' * 100_000}\n--- [{'!e!b x, ' * 9000}]",
        "a tag of more than 100 characters",
    ),
    "date": ("when: 2024-13-45", "no valid YAML: '2024-13-45' is no timestamp: month must be"),
    "digits": ("n: " + "9" * 5000, "no valid YAML: '999"),
    "bits": (f"n: {2**64}", "no valid YAML: '18446744073709551616' is no int: expected at most 64"),
    "keys of one hash": (
        "{" + ", ".join(f"{n * (2**61 - 1)}: 0" for n in range(9000)) + "}",
        "no valid YAML: '20752587082923245559' is no int: expected at most 64 bits",
    ),
    "hours": ("n: 1" + ":59" * 300, "no valid YAML: '1:59"),
    "fraction of hours": ("n: 1" + ":59" * 300 + ".5", "no valid YAML: '1:59"),
    **{
        f"no {tag}": (f"n: !!{tag} '{text}'", f"no valid YAML: '{text}' is no {tag}")
        for tag, text in [
            *(("timestamp", "foo"), ("bool", "foo"), ("int", "_"), ("int", ""), ("float", "")),
            *(("int", "1:x"), ("float", "."), ("timestamp", "2024-01-01 99:00:00")),
        ]
    },
    "no null": ("n: !!null [1]", "no valid YAML: "),
    "no set": ("n: !!set [1]", "no valid YAML: "),
    "no omap": ("n: !!omap {a: 1}", "no valid YAML: "),
    "no binary": ("n: !!binary é", "no valid YAML: "),
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
    begin = time.process_time()
    for load in (lambda: load_yaml(path), lambda: parse_yaml(data, path)):
        with pytest.raises(GridMapError) as caught:
            load()
        assert str(caught.value).startswith(f"{path}: {message}")
        assert len(str(caught.value)) < 500
    assert time.process_time() - begin < 2


def test_missing_file_is_named(tmp_path):
    with pytest.raises(GridMapError, match=r"nowhere\.yaml: cannot be read: No such file"):
        load_yaml(tmp_path / "nowhere.yaml")


def test_aliases_merge_keys_and_short_numbers_are_read():
    text = "a: &a {x: 1e-3, y: .5e2}\nb: {<<: *a, y: 2}\nc: [*a, *a]\nd: [1, 1.5, 2e3x, 0x10]\n"
    a = {"x": 0.001, "y": 50.0}
    expected = {"a": a, "b": {"x": 0.001, "y": 2}, "c": [a, a], "d": [1, 1.5, "2e3x", 16]}
    assert parse_yaml(text, "text") == expected
    assert parse_yaml("", "text") is None


def test_metadata_of_7000_bag_files_is_read_quickly():
    files = [
        {
            "path": f"bag_{number}.mcap",
            "starting_time": {"nanoseconds_since_epoch": number},
            "duration": {"nanoseconds": 10**9},
            "message_count": 30,
        }
        for number in range(7000)
    ]
    content = {"relative_file_paths": [file["path"] for file in files], "files": files}
    text = json.dumps(content)
    begin = time.process_time()
    assert parse_yaml(text, "metadata.yaml") == content
    assert time.process_time() - begin < 2
