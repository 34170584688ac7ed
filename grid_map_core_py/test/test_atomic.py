# SPDX-License-Identifier: BSD-3-Clause
"""Files and folders are written atomically even if the process is killed."""

import errno
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

from grid_map_core_py.files import _atomic as atomic, new_file, new_folder


def save_file(path: Path, text: str) -> None:
    with new_file(path) as temporary:
        temporary.write_text(text)


def save_folder(path: Path, text: str) -> None:
    with new_folder(path, lambda _: None) as temporary:
        (temporary / "one").write_text(text)
        (temporary / "two").write_text(text)


def read_folder(path: Path) -> set[str]:
    return {(path / name).read_text() for name in ("one", "two")}


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def remove_remains(folder: Path) -> None:
    """Remove the hidden files and folders that killed processes have left."""
    for path in folder.glob(".*.partial"):
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def killed_at_every_step(work: Callable[[], object], limit: int = 1000) -> Iterator[int]:
    """Run `work` in copies of this process, and kill each copy one step later than the last.

    A step is what Python announces to audit hooks: opening, renaming and removing files, making
    folders and so on. The last copy is not killed, because it has finished.

    Args:
        work: operation to run.
        limit: maximum number of steps.

    Yields:
        The number of the step before which the copy has died.
    """
    for step in range(limit):
        process = os.fork()
        if process == 0:
            die_before(step)
            work()
            os._exit(0)
        _, status = os.waitpid(process, 0)
        yield step
        if os.WIFEXITED(status):
            return
    raise AssertionError(f"more than {limit} steps")


def die_before(step: int) -> None:
    count = itertools.count()

    def die(event: str, _: object) -> None:
        watched = event.startswith(("os.", "fcntl.", "shutil.", "open", "ctypes.call"))
        if watched and next(count) == step:
            os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(die)


@pytest.fixture(params=["exchange", "aside"])
def exchange(request, monkeypatch) -> str:
    """Replace folders with and without a system call that exchanges two names."""
    if request.param == "aside":
        monkeypatch.setattr(atomic, "_exchange", lambda *_: False)
    return request.param


def test_killed_write_leaves_the_old_or_the_new_version(tmp_path):
    file, folder = tmp_path / "file", tmp_path / "folder"
    for path, save, read, steps in (
        (file, save_file, lambda path: {path.read_text()}, 5),
        (folder, save_folder, read_folder, 8),
    ):
        save(path, "old")
        found = []
        for _ in killed_at_every_step(lambda: save(path, "new")):  # noqa: B023
            (content,) = read(path)
            found.append(content)
            remove_remains(tmp_path)
            save(path, "old")
        assert {*found} == {"old", "new"}
        assert len(found) > steps
    assert names(tmp_path) == ["file", "folder"]


def test_killed_write_without_exchange_keeps_the_old_folder_beside(tmp_path, monkeypatch):
    monkeypatch.setattr(atomic, "_exchange", lambda *_: False)
    path = tmp_path / "folder"
    save_folder(path, "old")
    for _ in killed_at_every_step(lambda: save_folder(path, "new")):
        aside = [*tmp_path.glob(".folder.*.old")]
        assert read_folder(path if path.exists() else aside[0]) <= {"old", "new"}
        for remains in (*aside, *tmp_path.glob(".*.partial")):
            shutil.rmtree(remains)
        save_folder(path, "old")


def test_killed_write_leaves_no_part_of_a_new_folder(tmp_path):
    path = tmp_path / "folder"
    for _ in killed_at_every_step(lambda: save_folder(path, "new")):
        assert not path.exists() or read_folder(path) == {"new"}
    assert read_folder(path) == {"new"}


def test_error_keeps_the_old_file(tmp_path):
    save_folder(tmp_path / "folder", "old")
    save_file(tmp_path / "file", "old")
    with pytest.raises(TypeError):
        save_folder(tmp_path / "folder", 1)
    with pytest.raises(TypeError):
        save_file(tmp_path / "file", 1)
    assert read_folder(tmp_path / "folder") == {"old"}
    assert (tmp_path / "file").read_text() == "old"
    assert names(tmp_path) == ["file", "folder"]


@pytest.mark.usefixtures("exchange")
@pytest.mark.parametrize("call", ["rename", "replace", "fsync"])
def test_failing_disk_keeps_the_old_file(tmp_path, monkeypatch, call):
    save_folder(tmp_path / "folder", "old")
    save_file(tmp_path / "file", "old")

    def fail(*_):
        raise OSError(28, "No space left on device")

    for owner in (Path, os):
        monkeypatch.setattr(owner, call, fail, raising=False)
    for save, name in ((save_folder, "folder"), (save_file, "file")):
        with suppress(OSError):
            save(tmp_path / name, "new")
    monkeypatch.undo()
    assert read_folder(tmp_path / "folder") in ({"old"}, {"new"})
    assert (tmp_path / "file").read_text() in ("old", "new")
    assert names(tmp_path) == ["file", "folder"]


def test_files_in_progress_of_another_process_stay(tmp_path):
    with new_file(tmp_path / "file") as first:
        first.write_text("first")
        with new_folder(tmp_path / "folder", print) as slow:
            save_file(tmp_path / "file", "second")
            save_folder(tmp_path / "folder", "quick")
            assert first.exists()
            (slow / "one").write_text("slow")
            (slow / "two").write_text("slow")
    assert (tmp_path / "file").read_text() == "first"
    assert read_folder(tmp_path / "folder") == {"slow"}


def test_check_of_the_old_folder_may_refuse(tmp_path):
    save_folder(tmp_path / "folder", "old")

    def refuse(path: Path) -> None:
        raise PermissionError(f"keep {path.name}")

    with (
        pytest.raises(PermissionError, match="keep folder"),
        new_folder(tmp_path / "folder", refuse),
    ):
        pytest.fail("it was asked too late")
    assert names(tmp_path) == ["folder"]


def test_links_stay_and_their_targets_are_replaced(tmp_path):
    save_file(tmp_path / "file", "old")
    (tmp_path / "link").symlink_to("file")
    save_file(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "file").read_text() == "new"


def test_written_files_are_readable_by_others(tmp_path):
    save_file(tmp_path / "file", "")
    save_folder(tmp_path / "folder", "")
    (tmp_path / "plain").touch()
    plain = stat.S_IMODE((tmp_path / "plain").stat().st_mode)
    assert stat.S_IMODE((tmp_path / "file").stat().st_mode) == plain
    assert stat.S_IMODE((tmp_path / "folder").stat().st_mode) & 0o444 == plain & 0o444


def test_file_systems_need_no_synchronization(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.EINVAL, "not supported")

    monkeypatch.setattr("os.fsync", refuse)
    for text in ("old", "new"):
        save_file(tmp_path / "file", text)
        save_folder(tmp_path / "folder", text)
    assert (tmp_path / "file").read_text() == "new"
    assert read_folder(tmp_path / "folder") == {"new"}
    assert names(tmp_path) == ["file", "folder"]


def forked(work: Callable[[], object]) -> int:
    """Run `work` in a copy of this process, and return its id."""
    child = os.fork()
    if child == 0:
        with suppress(BaseException):
            work()
            os._exit(0)
        os._exit(1)
    return child


def test_processes_may_write_to_one_place(tmp_path):
    def save_often() -> None:
        for _ in range(15):
            save_folder(tmp_path / "folder", str(os.getpid()))
            save_file(tmp_path / "file", str(os.getpid()))

    children = [forked(save_often) for _ in range(3)]
    assert [os.waitpid(child, 0)[1] for child in children] == [0, 0, 0]
    assert len(read_folder(tmp_path / "folder")) == 1
    assert names(tmp_path) == ["file", "folder"]


def test_folder_made_by_another_process_meanwhile_is_replaced(tmp_path):
    folder = tmp_path / "folder"

    def make_it(event: str, arguments: tuple[object, ...]) -> None:
        if event == "os.rename" and str(arguments[1]) == str(folder) and not folder.exists():
            folder.mkdir()
            (folder / "theirs").touch()

    def save_meanwhile() -> None:
        sys.addaudithook(make_it)  # for the rest of the life of the process
        save_folder(folder, "ours")

    child = forked(save_meanwhile)
    assert os.waitpid(child, 0)[1] == 0
    assert read_folder(folder) == {"ours"}
    assert names(folder) == ["one", "two"]
    assert names(tmp_path) == ["folder"]
