# SPDX-License-Identifier: BSD-3-Clause
"""Runs of tiled maps that are killed, disturbed or refused, as real processes."""

import json
import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiled_sources import waves

from grid_map_core_py.errors import GridMapError
from grid_map_core_py.tiled import open_map
from grid_map_core_py.tiled._engine import in_any_order

pytestmark = [
    pytest.mark.needs("xarray", "zarr", "distributed"),
    pytest.mark.filterwarnings("error:.*Zarr.*"),
]

SCRIPT = Path(__file__).with_name("tiled_sources.py")
TILES = 7 * 5


def files(store: Path) -> dict[str, bytes]:
    return {str(f.relative_to(store)): f.read_bytes() for f in store.rglob("*") if f.is_file()}


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Files of a store that was written without disturbance."""
    folder = tmp_path_factory.mktemp("expected")
    waves(folder).to_zarr(folder / "out.zarr")
    return files(folder / "out.zarr")


@pytest.fixture
def target(tmp_path: Path) -> Iterator[Path]:
    """Path of a store; in the end there is only the store, or what resume needs."""
    (tmp_path / "out").mkdir()
    yield tmp_path / "out" / "out.zarr"
    assert {file.name for file in (tmp_path / "out").iterdir()} <= {"out.zarr", "out.zarr.part"}


def test_store_holds_the_map(tmp_path: Path, target: Path) -> None:
    site, counts = waves(tmp_path), []
    site.to_zarr(target, progress=lambda *count: counts.append(count))
    rows, columns = np.arange(100)[:, None], np.arange(70)
    wanted = np.sin(0.1 * rows) * np.cos(0.07 * columns)
    wanted[wanted > 0.9] = np.nan
    result = open_map(target)
    assert result.tile == (16, 16)
    np.testing.assert_array_equal(result.to_map()["variance"], (2 * wanted).astype(np.float32))
    assert counts == [(done, TILES) for done in range(TILES + 1)]
    assert (result.geometry, result.frame_id) == (site.geometry, "map")


def test_killed_worker_costs_no_bytes(
    cluster: Any, tmp_path: Path, target: Path, expected: dict[str, bytes]
) -> None:
    site = waves(tmp_path)
    (tmp_path / "kill").write_text("48 32")
    with cluster.as_current():
        site.to_zarr(target)
    assert not (tmp_path / "kill").exists()
    assert files(target) == expected
    assert site.source.computed().count("48 32") == 2


def test_warnings_of_workers_reach_the_client(cluster: Any) -> None:
    def doubled(number: int) -> int:
        warnings.warn(f"{number} is odd", RuntimeWarning, stacklevel=2)
        return 2 * number

    with cluster.as_current(), pytest.warns(RuntimeWarning) as caught:
        assert dict(in_any_order(doubled, (3, 5))) == {3: 6, 5: 10}
    assert {str(warning.message) for warning in caught} == {"3 is odd", "5 is odd"}


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Address and process of a scheduler with one worker."""
    file = tmp_path / "scheduler.json"
    environ = {**os.environ, "PYTHONPATH": os.pathsep.join([str(SCRIPT.parent), *sys.path])}
    options = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environ}

    def start(name: str, *words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{name}", "--scheduler-file", file]
        return subprocess.Popen([*command, "--no-dashboard", *words], **options)

    scheduler = start("scheduler", "--host", "127.0.0.1", "--port", "0")
    worker = start("worker", "--no-nanny", "--nthreads", "1", "--local-directory", str(tmp_path))
    wait_for(lambda: bool(file.read_text()), file)
    yield json.loads(file.read_text())["address"], scheduler
    for process in (worker, scheduler):
        process.kill()
        process.wait()


def test_lost_scheduler_ends_the_run(
    scheduler: tuple[str, subprocess.Popen[bytes]], tmp_path: Path, target: Path
) -> None:
    from distributed import Client

    address, process = scheduler
    (tmp_path / "wait").write_text("48 32")
    client = Client(address, set_as_default=False)
    client.wait_for_workers(1, timeout=30)

    def lose() -> None:
        wait_for(lambda: "48 32" in (tmp_path / "log").read_text(), tmp_path / "log")
        process.kill()
        (tmp_path / "wait").unlink()

    with ThreadPoolExecutor(1) as pool, client.as_current():
        lost = pool.submit(lose)
        with pytest.raises(GridMapError, match=rf"out.zarr: the cluster at {address} is lost$"):
            waves(tmp_path).to_zarr(target)
        lost.result()
    client.close(timeout=1)
    waves(tmp_path).to_zarr(target, resume=True)


def test_killed_client_resumes(tmp_path: Path, target: Path, expected: dict[str, bytes]) -> None:
    site = waves(tmp_path)
    (tmp_path / "kill").write_text("48 32")
    killed = subprocess.run([sys.executable, SCRIPT, tmp_path, target], check=False, timeout=60)
    assert killed.returncode == -signal.SIGKILL
    assert not target.exists()
    part = target.with_name("out.zarr.part")
    layers = [{f.name for f in (part / n).glob("[0-9]*.[0-9]")} for n in ("elevation", "variance")]
    finished = {tuple(map(int, name.split("."))) for name in layers[0] & layers[1]}
    assert 0 < len(finished) < TILES
    (part / "elevation" / "6.abc.partial").write_bytes(b"of a worker that was killed")
    with pytest.raises(
        GridMapError, match=r"out.zarr.part is left from .* 'resume' \(--resume\) continues"
    ):
        site.to_zarr(target)
    site.source.computed()
    counts: list[tuple[int, int]] = []
    site.to_zarr(target, resume=True, progress=lambda *count: counts.append(count))
    cells = [map(int, line.split()) for line in site.source.computed()]
    computed = {(row // 16, column // 16) for row, column in cells}
    assert computed == {divmod(n, 5) for n in range(TILES)} - finished
    assert counts[0] == (len(finished), TILES)
    assert files(target) == expected
    assert not part.exists()


def test_resume_of_another_run_is_refused(tmp_path: Path, target: Path) -> None:
    site = waves(tmp_path)
    (tmp_path / "fail").write_text("16 16")
    with pytest.raises(GridMapError, match="no waves"):
        site.to_zarr(target)
    part = target.with_name("out.zarr.part")
    before = files(part)
    with pytest.raises(GridMapError, match="begun with another tiles; remove it"):
        waves(tmp_path, tile=15).to_zarr(target, resume=True)
    with pytest.raises(GridMapError, match="begun with another layers"):
        site.to_zarr(target, resume=True, layers=["variance"])
    with pytest.raises(GridMapError, match="begun with another place"):
        replace(site, origin=(1.0, 0.0)).to_zarr(target, resume=True)
    assert files(part) == before


def test_interrupt_ends_promptly(tmp_path: Path, target: Path, expected: dict[str, bytes]) -> None:
    (tmp_path / "wait").write_text("48 32")
    command = [sys.executable, str(SCRIPT), str(tmp_path), str(target)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as running:
        wait_for(lambda: "48 32" in (tmp_path / "log").read_text(), tmp_path / "log")
        # A second run on the same target is refused meanwhile.
        with pytest.raises(GridMapError, match=r"out.zarr: another process is writing it"):
            waves(tmp_path).to_zarr(target, resume=True)
        running.send_signal(signal.SIGINT)
        # A busy machine may compute the other tiles before it interrupts.
        wait_for(lambda: True, tmp_path / "interrupted")
        (tmp_path / "wait").unlink()
        assert running.communicate(timeout=20)[1].strip().endswith("KeyboardInterrupt")
    assert len(waves(tmp_path).source.computed()) < TILES
    waves(tmp_path).to_zarr(target, resume=True)
    assert files(target) == expected


def wait_for(condition: Callable[[], bool], file: Path) -> None:
    end = time.monotonic() + 30
    while not (file.exists() and condition()):
        assert time.monotonic() < end
        time.sleep(0.01)


def test_full_disk_then_resume(
    tmp_path: Path, target: Path, full_disk: Callable[[int], AbstractContextManager[None]]
) -> None:
    # Chunks are larger than the description of the store.
    site = waves(tmp_path, tile=60)
    site.to_zarr(tmp_path / "expected.zarr")
    expected = files(tmp_path / "expected.zarr")
    largest = max(len(content) for name, content in expected.items() if name[-1].isdecimal())
    text = r"^\S+/out.zarr.part/(elevation|variance): cannot be written: File too"
    with full_disk(largest - 1), pytest.raises(GridMapError, match=text):
        site.to_zarr(target)
    assert not target.exists()
    assert target.with_name("out.zarr.part").exists()
    site.to_zarr(target, resume=True)
    assert files(target) == expected


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("/proc/out.zarr", "^/proc/out.zarr: cannot be written: "),
        ("/no/such/folder/out.zarr", "^/no/such/folder/out.zarr: cannot be written: "),
        ("memory://out.zarr", "path: expected a folder of this machine"),
        ("out.tif", r"expected a name that ends in \.zarr"),
    ],
)
def test_wrong_targets_are_refused(tmp_path: Path, path: str, text: str) -> None:
    with pytest.raises(GridMapError, match=text):
        waves(tmp_path).to_zarr(path)
    assert not (tmp_path / "log").exists()


def test_overwrite_replaces_stores_only(
    tmp_path: Path, target: Path, expected: dict[str, bytes]
) -> None:
    site = waves(tmp_path)
    waves(tmp_path, size=(5, 5)).to_zarr(target)
    old = files(target)
    with pytest.raises(GridMapError, match=r"out.zarr: already exists; 'overwrite' replaces it"):
        site.to_zarr(target)
    (tmp_path / "fail").write_text("48 32")
    with pytest.raises(GridMapError, match="no waves"):
        site.to_zarr(target, overwrite=True)
    assert files(target) == old
    (tmp_path / "fail").unlink()
    site.to_zarr(target, overwrite=True, resume=True)
    assert files(target) == expected
    (target / ".zgroup").unlink()
    with pytest.raises(GridMapError, match=r"expected a Zarr store, got a folder without \.zgroup"):
        site.to_zarr(target, overwrite=True)


def test_store_may_replace_its_own_source(tmp_path: Path, target: Path) -> None:
    waves(tmp_path).to_zarr(target)
    before = open_map(target).to_map()
    open_map(target, chunks=32).to_zarr(target, overwrite=True)
    assert open_map(target).tile == (32, 32)
    assert open_map(target).to_map() == before


def test_damaged_chunk_of_the_source(tmp_path: Path, target: Path) -> None:
    source = tmp_path / "dem.zarr"
    waves(tmp_path).to_zarr(source)
    (source / "variance" / "1.2").write_bytes(b"nothing")
    with pytest.raises(GridMapError) as error:
        open_map(source).to_zarr(target)
    text = f"{target}: cells [16:32, 32:48]: {source}/variance: cannot be read: "
    assert str(error.value).startswith(text)


def test_threads_stop_at_the_first_error() -> None:
    from dask import config

    calls: list[int] = []

    def call(number: int) -> int:
        calls.append(number)
        if number == 20:
            raise GridMapError("at 20")
        return number

    with config.set(num_workers=2), pytest.raises(GridMapError, match="at 20"):
        [*in_any_order(call, range(10**6))]
    assert len(calls) < 40


@pytest.mark.parametrize("scheduler", ["synchronous", "threads", "processes"])
def test_local_schedulers_give_the_same_bytes(
    scheduler: str, tmp_path: Path, target: Path, expected: dict[str, bytes]
) -> None:
    from dask import config

    with config.set(scheduler=scheduler, num_workers=2):
        waves(tmp_path).to_zarr(target)
    assert files(target) == expected
