# SPDX-License-Identifier: BSD-3-Clause
"""Atomic writing, and every writer of files: full disks, missing folders, other endings."""

import itertools
import os
import shutil
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from grid_map_core_py import GridMap, GridMapError, load, save
from grid_map_core_py.files._shared import new_file, new_folder

OPTIONS = {
    "map.npz": {},
    "packed.npz": {"compress": True},
    "map.tif": {},
    "packed.tif": {"compress": True},
    "height.tif": {"bits": 32},
    "height.png": {},
    "occupancy.yaml": {"mode": "raw", "data_min": 0, "data_max": 100},
    "scaled.yaml": {"mode": "scale", "data_min": 0, "data_max": 100},
}
"""Files of all writers, with options of `save`."""

GDAL = pytest.mark.needs("rasterio")
WRITERS = [
    pytest.param(name, marks=GDAL if name in ("map.tif", "packed.tif") else ()) for name in OPTIONS
]


def noise(seed: int) -> GridMap:
    values = np.random.default_rng(seed).uniform(0, 100, (300, 250))
    return GridMap((30, 25), 0.1, layers={"elevation": values}, timestamp=seed)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(file): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.mark.parametrize("limit", [0, 50_000])
@pytest.mark.parametrize("name", WRITERS)
def test_full_disk_keeps_the_old_file(tmp_path, capfd, full_disk, name, limit):
    path, options = tmp_path / name, OPTIONS[name]
    save(noise(1), path, **options)
    old = contents(tmp_path)
    with (
        full_disk(limit),
        pytest.raises(GridMapError, match=rf"{tmp_path}/\S+: cannot be written: File too large"),
    ):
        save(noise(2), path, **options)
    assert contents(tmp_path) == old
    assert capfd.readouterr() == ("", "")
    save(noise(2), path, **options)
    assert contents(tmp_path) != old


@pytest.mark.parametrize("name", WRITERS)
def test_folder_without_permission_is_named(tmp_path, name):
    folder = tmp_path / "theirs"
    folder.mkdir(mode=0o500)
    if os.access(folder, os.W_OK):  # as root
        folder = Path("/proc")
    with pytest.raises(GridMapError, match=rf"{folder}/\S+: cannot be written: ") as caught:
        save(noise(1), folder / name, **OPTIONS[name])
    assert ".partial" not in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "name", "expected"),
    [
        ("npz", "x.PNG", r"a name that ends in \.npz"),
        ("geotiff", "x.npz", r"a name that ends in \.tif or \.tiff"),
        ("map_server", "x.pgm", r"a name that ends in \.yaml or \.yml"),
        ("height_image", "x", r"a name that ends in \.png or \.tif"),
    ],
)
def test_ending_of_another_kind_of_file_is_refused(tmp_path, kind, name, expected):
    with pytest.raises(GridMapError, match=f"{name}: expected {expected}"):
        save(noise(1), tmp_path / name, format=kind)
    assert not [*tmp_path.iterdir()]


@GDAL
@pytest.mark.parametrize("name", ["plain", "site.v2"])
def test_names_without_known_ending_take_any_format(tmp_path, name):
    for kind in ("npz", "geotiff"):
        save(noise(1), tmp_path / name, format=kind)
        assert load(tmp_path / name, format=kind) == noise(1)


# --- atomic writing -------------------------------------------------------------------------------


def save_file(path: Path, text: str) -> None:
    with new_file(path) as temporary:
        temporary.write_text(text)


def save_folder(path: Path, text: str) -> None:
    with new_folder(path, lambda _: None) as temporary:
        (temporary / "one").write_text(text)
        (temporary / "two").write_text(text)


def read_file(path: Path) -> set[str]:
    return {path.read_text()}


def read_folder(path: Path) -> set[str]:
    return {(path / name).read_text() for name in ("one", "two")}


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def old(tmp_path) -> Path:
    """Return a folder with the file `file` and the folder `folder`."""
    save_folder(tmp_path / "folder", "old")
    save_file(tmp_path / "file", "old")
    return tmp_path


def killed_at_every_step(work: Callable[[], object]) -> Iterator[None]:
    """Run `work` in copies of this process, and kill each copy one step later than the last.

    A step is what Python announces to audit hooks: opening, renaming and removing files, making
    folders and so on. The last copy is not killed, because it has finished.
    """
    for step in range(1000):
        process = os.fork()
        if process == 0:
            die_before(step)
            work()
            os._exit(0)
        _, status = os.waitpid(process, 0)
        yield
        if os.WIFEXITED(status):
            return
    raise AssertionError("too many steps")


def die_before(step: int) -> None:
    count = itertools.count()

    def die(event: str, _: object) -> None:
        if event.startswith(("os.", "shutil.", "open")) and next(count) == step:
            os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(die)


@pytest.mark.parametrize(
    ("name", "write", "read"),
    [("file", save_file, read_file), ("folder", save_folder, read_folder)],
)
def test_killed_write_leaves_the_old_or_the_new_version(tmp_path, name, write, read):
    path, found = tmp_path / name, []
    write(path, "old")
    for _ in killed_at_every_step(lambda: write(path, "new")):
        # A folder has its old content beside it for an instant.
        (content,) = read(path if path.exists() else next(tmp_path.glob(".folder.*.old")))
        found.append(content)
        for remains in tmp_path.iterdir():
            shutil.rmtree(remains) if remains.is_dir() else remains.unlink()
        write(path, "old")
    assert {*found} == {"old", "new"}
    assert len(found) > 4


@pytest.mark.parametrize("call", ["rename", "replace", "fsync"])
def test_failing_disk_keeps_the_old_version(old, monkeypatch, call):
    def fail(*_):
        raise OSError(28, "No space left on device")

    for owner in (Path, os):
        monkeypatch.setattr(owner, call, fail, raising=False)
    for write, name in ((save_folder, "folder"), (save_file, "file")):
        with suppress(OSError):
            write(old / name, "new")
    monkeypatch.undo()
    assert read_folder(old / "folder") in ({"old"}, {"new"})
    assert read_file(old / "file") in ({"old"}, {"new"})
    assert names(old) == ["file", "folder"]


def test_check_of_the_old_folder_may_refuse(old):
    def refuse(path: Path) -> None:
        raise PermissionError(f"keep {path.name}")

    with pytest.raises(PermissionError, match="keep folder"), new_folder(old / "folder", refuse):
        pytest.fail("it was asked too late")
    assert names(old) == ["file", "folder"]


def test_links_stay_and_their_targets_are_replaced(old):
    (old / "link").symlink_to("file")
    save_file(old / "link", "new")
    assert (old / "link").is_symlink()
    assert read_file(old / "file") == {"new"}
