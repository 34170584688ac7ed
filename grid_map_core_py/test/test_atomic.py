# SPDX-License-Identifier: BSD-3-Clause
"""Files and folders are written atomically even if the process is killed."""

import itertools
import os
import shutil
import signal
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from grid_map_core_py._files import new_file, new_folder


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
    ("name", "save", "read"),
    [("file", save_file, read_file), ("folder", save_folder, read_folder)],
)
def test_killed_write_leaves_the_old_or_the_new_version(tmp_path, name, save, read):
    path, found = tmp_path / name, []
    save(path, "old")
    for _ in killed_at_every_step(lambda: save(path, "new")):
        # A folder has its old content beside it for an instant.
        (content,) = read(path if path.exists() else next(tmp_path.glob(".folder.*.old")))
        found.append(content)
        for remains in tmp_path.iterdir():
            shutil.rmtree(remains) if remains.is_dir() else remains.unlink()
        save(path, "old")
    assert {*found} == {"old", "new"}
    assert len(found) > 4


def test_error_keeps_the_old_version(old):
    for save, name in ((save_folder, "folder"), (save_file, "file")):
        with pytest.raises(TypeError):
            save(old / name, 1)
    assert (read_folder(old / "folder"), read_file(old / "file")) == ({"old"}, {"old"})
    assert names(old) == ["file", "folder"]


@pytest.mark.parametrize("call", ["rename", "replace", "fsync"])
def test_failing_disk_keeps_the_old_version(old, monkeypatch, call):
    def fail(*_):
        raise OSError(28, "No space left on device")

    for owner in (Path, os):
        monkeypatch.setattr(owner, call, fail, raising=False)
    for save, name in ((save_folder, "folder"), (save_file, "file")):
        with suppress(OSError):
            save(old / name, "new")
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


def test_errors_name_the_given_path(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"there is no folder .*none"):
        save_file(tmp_path / "none" / "file", "new")
    with pytest.raises(FileNotFoundError) as caught, new_file(tmp_path / "file"):
        pass
    assert caught.value.filename == str(tmp_path / "file")


def test_links_stay_and_their_targets_are_replaced(old):
    (old / "link").symlink_to("file")
    save_file(old / "link", "new")
    assert (old / "link").is_symlink()
    assert read_file(old / "file") == {"new"}


def test_written_files_are_readable_by_others(old):
    (old / "plain").touch()
    plain = stat.S_IMODE((old / "plain").stat().st_mode)
    assert stat.S_IMODE((old / "file").stat().st_mode) == plain
    assert stat.S_IMODE((old / "folder").stat().st_mode) & 0o444 == plain & 0o444
