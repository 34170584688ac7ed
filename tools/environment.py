# SPDX-License-Identifier: BSD-3-Clause
"""Python environments of the workspace, and the shell environment in which they run."""

import importlib.metadata
import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path

from machine import BOOTSTRAP_GUARD, apt_install
from steps import ROOT, Refusal, digest, run, say, write_atomically

VENV = ROOT / ".venv"
VENV_DOCS = ROOT / ".venv-docs"
VENV_OLDEST = ROOT / ".venv-oldest"
PYTHON = f"python{sys.version_info.major}.{sys.version_info.minor}"
SITE_PACKAGES = VENV / "lib" / PYTHON / "site-packages"

PINS = ROOT / "tools" / "requirements.in"
"""Pinned versions of the direct requirements; `REQUIREMENTS` adds hashes and dependencies."""

PINS_OLDEST = ROOT / "tools" / "requirements-oldest.in"
"""Pinned versions of the direct requirements in `REQUIREMENTS_OLDEST`."""

REQUIREMENTS = ROOT / "tools" / "requirements.txt"
REQUIREMENTS_BUILD = ROOT / "tools" / "requirements-build.txt"
REQUIREMENTS_DOCS = ROOT / "tools" / "requirements-docs.txt"
REQUIREMENTS_OLDEST = ROOT / "tools" / "requirements-oldest.txt"

BROWSERS = VENV / "browsers"
BROWSERS_PATH = "PLAYWRIGHT_BROWSERS_PATH"
WHERE_CHROMIUM_IS = """
from playwright.sync_api import sync_playwright
with sync_playwright() as driver:
    print(driver.chromium.executable_path)
"""

RECIPE = "1"
"""Increase this version when a code change requires existing environments to be rebuilt."""

ADDED_TO_ROS = (
    "argcomplete",
    "dask",
    "distributed",
    "hypothesis",
    "import-linter",
    "lark",
    "mcap",
    "mypy",
    "numba",
    "numcodecs",
    "pandas",
    "playwright",
    "pypcd4",
    "pyproj",
    "pytest-benchmark",
    "pytest-timeout",
    "rasterio",
    "rio-cogeo",
    "rioxarray",
    "rosbags",
    "ruff",
    "shapely",
    "trimesh",
    "types-PyYAML",
    "viser",
    "xarray",
    "zarr",
)
"""Distributions that `.venv` adds to a sourced ROS if they are missing there."""

OLDEST_BESIDE_ROS = {"dask", "distributed", "numcodecs", "pandas", "rioxarray", "xarray", "zarr"}
"""Added distributions whose current versions need newer packages than Ubuntu 24.04 provides."""

RENEWED = {"importlib_metadata", "packaging", "typing_extensions"}
"""Pure Python packages with a stable interface; `.venv` may have newer versions than ROS."""


def setup(outer: Mapping[str, str], ros: bool) -> str:
    """Create `.venv` unless it is up to date, and return the fingerprint of its inputs."""
    fill = _add_to_ros if ros else _install_ros
    options = ["--system-site-packages"] if ros else []
    _ensure_venv(VENV, _wanted(ros), outer, options, lambda: fill(outer))
    return _wanted(ros)


def setup_oldest(outer: Mapping[str, str]) -> None:
    """Create `.venv-oldest`, without ROS, unless it is up to date."""
    fingerprint = _fingerprint("oldest", REQUIREMENTS_BUILD, REQUIREMENTS_OLDEST)
    fill = partial(_install, VENV_OLDEST, outer, REQUIREMENTS_OLDEST)
    _ensure_venv(VENV_OLDEST, fingerprint, outer, [], fill)


def setup_docs(outer: Mapping[str, str], ros: bool) -> None:
    """Create `.venv-docs` for the documentation unless it is up to date.

    It is separate from `.venv`, which with a sourced ROS has package versions of Ubuntu 24.04 that
    are too old for Sphinx.
    """
    fingerprint = _fingerprint(f"docs {ros}", REQUIREMENTS_BUILD, REQUIREMENTS_DOCS)
    options = ["--system-site-packages"] if ros else []
    fill = partial(_install, VENV_DOCS, outer, REQUIREMENTS_DOCS)
    _ensure_venv(VENV_DOCS, fingerprint, outer, options, fill)


def is_set_up(ros: bool) -> bool:
    """Return whether `.venv` is complete and matches the current requirements and ROS."""
    return _is_complete(VENV, _wanted(ros))


def ensure_browser(inner: Mapping[str, str]) -> None:
    """Install Chromium for the viewer tests, unless an installed one starts."""
    if _chromium_starts(inner):
        return
    try:
        # The Ubuntu package needs snap, which containers lack.
        is_debian = platform.freedesktop_os_release().get("ID") == "debian"
        if not (is_debian and apt_install(["chromium", "fonts-dejavu-core"], inner)):
            say("Installing Chromium of Playwright into .venv/browsers ...")
            dependencies = ["--with-deps"] if os.geteuid() == 0 else []
            command = (VENV / "bin" / "python", "-m", "playwright", "install", *dependencies)
            run(*command, "chromium", environ={**inner, BROWSERS_PATH: str(BROWSERS)})
        installed = _chromium_starts(inner)
    except Refusal:
        installed = False
    if not installed:
        raise Refusal(
            "The tests of the viewer need Chromium, which cannot be installed here: install it as"
            " root (Debian: apt install chromium), or the libraries of Playwright's own"
            " (.venv/bin/python -m playwright install-deps chromium)."
        )


def _chromium_starts(inner: Mapping[str, str]) -> bool:
    """Return whether the system's Chromium, or else Playwright's, starts."""
    path = inner.get("PATH", "")
    found = (shutil.which(name, path=path) for name in ("chromium", "chromium-browser"))
    program = next(filter(None, found), None)
    if program is None:
        environ = {**inner, **_browsers()}
        done = subprocess.run(
            [VENV / "bin" / "python", "-c", WHERE_CHROMIUM_IS],
            env=environ,
            capture_output=True,
            text=True,
            check=False,
        )
        program = done.stdout.strip()
    if not Path(program).is_file():
        return False
    return subprocess.run([program, "--version"], capture_output=True, check=False).returncode == 0


def _browsers() -> dict[str, str]:
    """Return the variable that points Playwright to its own browsers, if they are installed."""
    return {BROWSERS_PATH: str(BROWSERS)} if BROWSERS.is_dir() else {}


def _wanted(ros: bool) -> str:
    if ros:
        return _fingerprint("beside ROS", PINS, PINS_OLDEST)
    return _fingerprint("with ROS", REQUIREMENTS_BUILD, REQUIREMENTS)


def _fingerprint(kind: str, *sources: Path) -> str:
    # The path is included because an environment cannot be moved.
    python = (sys.version, sys.base_prefix)
    return digest(RECIPE, kind, str(ROOT), *python, *(path.read_bytes() for path in sources))


def _is_complete(venv: Path, fingerprint: str) -> bool:
    stamp = venv / ".complete"
    return stamp.exists() and stamp.read_text() == fingerprint


def _ensure_venv(
    venv: Path,
    fingerprint: str,
    outer: Mapping[str, str],
    options: Iterable[str],
    fill: Callable[[], None],
) -> None:
    """Recreate `venv` unless it is complete and has this `fingerprint`."""
    if _is_complete(venv, fingerprint):
        return
    stamp = venv / ".complete"
    say(f"Making {venv.name} with Python {platform.python_version()}; this takes minutes, once ...")
    # Remove the stamp first: an interrupted removal must not leave a stamp.
    stamp.unlink(missing_ok=True)
    if venv.exists():
        shutil.rmtree(venv)
    run(sys.executable, "-m", "venv", *options, venv, environ=outer)
    # The wheels contain package.xml files, which colcon would treat as workspace packages, and lack
    # the setup files that colcon expects in every prefix.
    for name in ("COLCON_IGNORE", "local_setup.sh", "local_setup.bash", "local_setup.zsh"):
        (venv / name).touch()
    fill()
    write_atomically(stamp, fingerprint)


def _pip(venv: Path, outer: Mapping[str, str], *arguments: str | Path) -> None:
    install = ("-m", "pip", "install", "--no-input", "--disable-pip-version-check")
    environ = {**outer, BOOTSTRAP_GUARD: "1", "PIP_PROGRESS_BAR": "off"}
    run(venv / "bin" / "python", *install, *arguments, environ=environ, takes_long=True)


def _install(venv: Path, outer: Mapping[str, str], requirements: Path) -> None:
    """Install exactly the packages that a file lists; a different hash is an error."""
    # Isolated builds would download their requirements without checking hashes.
    for file in (REQUIREMENTS_BUILD, requirements):
        words = ("--require-hashes", "--no-deps", "--no-build-isolation", "-r", file)
        _pip(venv, outer, *words)


def _install_ros(outer: Mapping[str, str]) -> None:
    _install(VENV, outer, REQUIREMENTS)
    # The CMake files in the wheels contain Python paths of the machine that built the wheels.
    there = r"/opt/python/cp\d+-cp\d+"
    numpy = SITE_PACKAGES / "numpy" / "_core" / "include"
    for path in (VENV / "share").rglob("*.cmake"):
        text = path.read_text()
        here = re.sub(rf"{there}/lib/{PYTHON}/site-packages/numpy/_core/include", str(numpy), text)
        here = re.sub(rf"{there}/include/{PYTHON}", sysconfig.get_path("include"), here)
        if here != text:
            path.write_text(here)


def _add_to_ros(outer: Mapping[str, str]) -> None:
    """Install the missing tools without changing the versions of installed packages."""
    installed = {dist.name: dist.version for dist in importlib.metadata.distributions()}
    known = {str(name).lower() for name in installed}
    missing = [name for name in ADDED_TO_ROS if name.lower() not in known]
    if not missing:
        return
    held = VENV / "installed-with-ros.txt"
    # A version with a local suffix, as Debian may use, would make pip reject the whole file.
    plain = re.compile(r"[\w.-]+==\d+(\.\d+)*")
    kept = {n: v for n, v in installed.items() if n.lower().replace("-", "_") not in RENEWED}
    lines = [f"{name}=={version}" for name, version in kept.items()]
    held.write_text("\n".join(filter(plain.fullmatch, lines)))
    _pip(VENV, outer, "-c", held, *_pins_of(missing))


def _pins_of(names: Iterable[str]) -> list[str]:
    newest, oldest = (
        {line.partition("==")[0]: line.strip() for line in path.read_text().splitlines()}
        for path in (PINS, PINS_OLDEST)
    )
    return [(oldest if name in OLDEST_BESIDE_ROS else newest)[name] for name in names]


def inner_environment(outer: Mapping[str, str], ros: bool) -> dict[str, str]:
    """Return the environment for builds; to run programs, also source `install/local_setup.*`."""
    if ros:  # ROS packages come first; ours fill the gaps.
        ours = {
            "PATH": _path_list(outer.get("PATH"), VENV / "bin"),
            "PYTHONPATH": _path_list(outer.get("PYTHONPATH"), SITE_PACKAGES),
        }
    else:
        # Otherwise, each Python process would assemble these paths again at startup, in random
        # order.
        libraries = [VENV / "lib", *sorted(SITE_PACKAGES.glob("ros_*.libs"))]
        ours = {
            "PATH": _path_list(VENV / "bin", outer.get("PATH")),
            "AMENT_PREFIX_PATH": _path_list(outer.get("AMENT_PREFIX_PATH"), VENV),
            "LD_LIBRARY_PATH": _path_list(*libraries, outer.get("LD_LIBRARY_PATH")),
            "VIRTUAL_ENV": str(VENV),
            BOOTSTRAP_GUARD: "1",
            "RMW_IMPLEMENTATION": outer.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp"),
        }
    return {**outer, **ours, **_fast_dds(outer), **_browsers(), "GRID_MAP_PY_ROOT": str(ROOT)}


def _fast_dds(outer: Mapping[str, str]) -> dict[str, str]:
    """Return the Fast DDS setting for large maps and clouds; see `nodes/_profile.py`."""
    profile = ROOT / "grid_map_ros_py" / "grid_map_ros_py" / "fastdds_large_maps.xml"
    has_chosen = any(name.startswith(("FASTRTPS_", "FASTDDS_")) for name in outer)
    memory = Path("/dev/shm")
    if has_chosen or not memory.is_dir() or shutil.disk_usage(memory).free < 2**28:
        return {}
    return {"FASTRTPS_DEFAULT_PROFILES_FILE": str(profile)}


def _path_list(*entries: str | Path | None) -> str:
    return ":".join(str(entry) for entry in entries if entry)
