# SPDX-License-Identifier: BSD-3-Clause
"""Checks of the machine and the calling shell before any work starts."""

import importlib.util
import os
import platform
import shutil
import sys
import sysconfig
from collections.abc import Iterable, Mapping
from pathlib import Path

from steps import ROOT, Refusal, run, say

PATH_LISTS = (
    "PATH",
    "PYTHONPATH",
    "LD_LIBRARY_PATH",
    "AMENT_PREFIX_PATH",
    "CMAKE_PREFIX_PATH",
)

BOOTSTRAP_GUARD = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
"""While this variable is set, the ROS wheels do not restart each Python process."""

BESIDE_ROS = {
    "cv2": "python3-opencv",
    "matplotlib": "python3-matplotlib",
    "numpy": "python3-numpy",
    "pytest": "python3-pytest",
    "scipy": "python3-scipy",
    "yaml": "python3-yaml",
}
"""Debian package of each module that must come with a sourced ROS, never from pip: ROS is compiled
against these versions, and a second copy would shadow them."""

NO_BYTE_CODE = "PYTHONDONTWRITEBYTECODE"
"""Variable that makes colcon warn, and each program of the tests compile what it imports."""


def outer_environment(environ: Mapping[str, str]) -> dict[str, str]:
    """Return `environ` as it was before sourcing tools/env.sh of this or another checkout."""
    outer = dict(environ)
    roots = {str(ROOT), outer.pop("GRID_MAP_PY_ROOT", str(ROOT))}
    outer.pop(NO_BYTE_CODE, None)
    for name in PATH_LISTS:
        entries = [entry for entry in outer.pop(name, "").split(":") if entry]
        if foreign := [entry for entry in entries if not _is_below(entry, roots)]:
            outer[name] = ":".join(foreign)
    if _is_below(outer.get("VIRTUAL_ENV", ""), roots):
        del outer["VIRTUAL_ENV"]
        outer.pop(BOOTSTRAP_GUARD, None)
    return outer


def _is_below(path: str, roots: set[str]) -> bool:
    return any(path.startswith(root + "/") for root in roots)


def ros_is_sourced(outer: Mapping[str, str]) -> bool:
    """Return whether ROS is sourced; refuse an unsupported distribution."""
    distro = outer.get("ROS_DISTRO")
    if distro not in (None, "jazzy"):
        raise Refusal(
            f"ROS 2 Jazzy is needed, but the ROS distribution '{distro}' is sourced: source Jazzy"
            " instead, or use a shell without ROS."
        )
    if distro is None or "AMENT_PREFIX_PATH" not in outer:
        return False
    if importlib.util.find_spec("rclpy") is None:
        raise Refusal(
            f"ROS 2 Jazzy is sourced, but {sys.executable} cannot import its rclpy: install"
            f" ros-{distro}-rclpy, or leave the Python environment that hides the Python of ROS."
        )
    return True


def check(outer: Mapping[str, str], ros: bool) -> None:
    """Refuse a machine on which the setup or the build would fail, before any work starts.

    For root on Debian or Ubuntu, install the missing packages instead.
    """
    if " " in str(ROOT):
        raise Refusal(f"Move the workspace out of '{ROOT}' to a path without spaces.")
    system = f"{platform.system()} {platform.machine()}"
    if not ros and system != "Linux x86_64":
        raise Refusal(
            f"Wheels of ROS 2 exist for x86-64 Linux only, and this is {system}: install ROS 2"
            " Jazzy and source it, or work in a container that has it."
        )
    lacking = _lacking(outer, ros)
    if lacking and apt_install(lacking.values(), outer):
        importlib.invalidate_caches()
        lacking = _lacking(outer, ros)
    if lacking:
        raise Refusal(
            f"This machine lacks {', '.join(lacking)}: install what is missing (Debian and Ubuntu:"
            f" apt install {' '.join(lacking.values())})."
        )


def apt_install(packages: Iterable[str], outer: Mapping[str, str]) -> bool:
    """Install Debian packages, with a message; return False for users without permission."""
    if os.geteuid() != 0 or shutil.which("apt-get", path=outer.get("PATH", "")) is None:
        return False
    say(f"Installing {' '.join(packages)} with apt-get ...")
    environ = {**outer, "DEBIAN_FRONTEND": "noninteractive"}
    run("apt-get", "update", "-qq", environ=environ)
    run("apt-get", "install", "-qq", "-y", "--no-install-recommends", *packages, environ=environ)
    return True


def _lacking(outer: Mapping[str, str], ros: bool) -> dict[str, str]:
    """Return the missing build programs and modules, each with its Debian package."""

    def absent(*programs: str) -> bool:
        return not any(shutil.which(program, path=outer.get("PATH", "")) for program in programs)

    headers = Path(sysconfig.get_path("include"), "Python.h")
    python = f"python{sys.version_info.major}"
    needs = {
        "cmake": ("cmake", absent("cmake")),
        "make": ("make", absent("make")),
        "a C compiler": ("gcc", absent(outer.get("CC", "cc"), "gcc", "clang")),
        "a C++ compiler": ("g++", absent(outer.get("CXX", "c++"), "g++", "clang++")),
        "the Python headers": (f"{python}-dev", not headers.exists()),
        "venv": (f"{python}-venv", importlib.util.find_spec("ensurepip") is None),
        "colcon": ("python3-colcon-common-extensions", ros and absent("colcon")),
    }
    for module, package in BESIDE_ROS.items() if ros else ():
        needs[module] = (package, importlib.util.find_spec(module) is None)
    return {what: package for what, (package, missing) in needs.items() if missing}
