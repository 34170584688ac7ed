# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Which of the packages that we use are there, and whether they work."""

import json
import subprocess
import sys
from typing import Any, NamedTuple


class Package(NamedTuple):
    """A package that we use.

    Attributes:
        module: name of the Python module.
        group: "required", "ROS" or "optional".
        gives: feature that needs it.
        remedy: command that installs it.
        distribution: name of the pip package; empty if equal to the module.
    """

    module: str
    group: str
    gives: str
    remedy: str
    distribution: str = ""


_OURS = "build and source the workspace"
_SOURCE = "source ROS 2 Jazzy, then the workspace"


def _optional(module: str, gives: str, remedy: str = "") -> Package:
    return Package(module, "optional", gives, remedy or f"pip install {module}")


PACKAGES = (
    Package("numpy", "required", "arrays", "apt install python3-numpy"),
    Package("scipy", "required", "filters and distances", "apt install python3-scipy"),
    Package("cv2", "required", "images", "apt install python3-opencv", "opencv-python-headless"),
    Package("yaml", "required", "parameter files", "apt install python3-yaml", "PyYAML"),
    Package("lark", "required", "expressions", "apt install python3-lark"),
    Package("grid_map_core_py", "required", "maps", _OURS),
    Package("grid_map_filters_py", "required", "filters", _OURS),
    Package("rclpy", "ROS", "nodes", _SOURCE, "ros-rclpy"),
    Package("sensor_msgs.msg", "ROS", "messages", _SOURCE, "ros-sensor-msgs"),
    Package("grid_map_msgs.msg", "ROS", "bags and topics of maps", _OURS, "grid_map_msgs"),
    Package("grid_map_ros_py", "ROS", "bags and conversions", _OURS),
    Package("grid_map_visualization_py", "ROS", "pictures and what RViz shows", _OURS),
    _optional("mcap", "bags in MCAP files"),
    _optional("matplotlib", "pictures and colour maps", "apt install python3-matplotlib"),
    _optional("viser", "maps in the browser"),
    _optional("rasterio", "GeoTIFF"),
    _optional("trimesh", "PLY, OBJ and STL files"),
    _optional("pypcd4", "PCD files"),
    _optional("numba", "faster filters"),
    _optional("argcomplete", "completion in the shell", "apt install python3-argcomplete"),
    _optional("octomap_msgs.msg", "octomaps", "apt install ros-jazzy-octomap-msgs"),
    _optional("nav2_msgs.msg", "costmaps of nav2", "apt install ros-jazzy-nav2-msgs"),
    _optional("tf2_ros", "clouds in other frames", "apt install ros-jazzy-tf2-ros-py"),
)


class Finding(NamedTuple):
    """What was found of a package; `status` is "ok", "missing" or "broken"."""

    package: Package
    status: str
    version: str
    error: str

    @property
    def text(self) -> str:
        """What people want to know about it."""
        if self.status == "ok":
            return self.version
        reason = f": {self.error}" if self.error else ""
        return f"{self.package.gives} ({self.package.remedy}){reason}"

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        details = {"status": self.status, "version": self.version, "error": self.error}
        names = ("module", "group", "gives", "remedy")
        return {name: getattr(self.package, name) for name in names} | details


def ros_is_wanted(findings: list[Finding]) -> bool:
    """Tell whether ROS has been installed at all; files can do without."""
    found = (one for one in findings if one.package.module in ("rclpy", "sensor_msgs.msg"))
    return any(one.status != "missing" for one in found)


def is_failure(finding: Finding, *, with_ros: bool) -> bool:
    """Tell whether something does not work that should."""
    needed = ("required", "ROS") if with_ros else ("required",)
    return finding.package.group in needed and finding.status != "ok"


_PROBE = """
import importlib, json, os, sys
from importlib import metadata

answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
for word in sys.argv[1:]:
    module, distribution = word.split(",")
    status, version, error = "ok", "", ""
    try:
        loaded = importlib.import_module(module)
    except ModuleNotFoundError as problem:
        status = "missing" if module.startswith(problem.name or module) else "broken"
        error = "" if status == "missing" else str(problem)
    except BaseException as problem:
        status, error = "broken", f"{type(problem).__name__}: {problem}"
    else:
        version = str(getattr(loaded, "__version__", ""))
    for name in (distribution, module.partition(".")[0]):
        try:
            version = version or (metadata.version(name) if status == "ok" else "")
        except metadata.PackageNotFoundError:
            pass
    print(json.dumps([status, version, " ".join(error.split())]), file=answers, flush=True)
"""


def examined(packages: tuple[Package, ...] = PACKAGES) -> list[Finding]:
    """Import packages, in a process of their own, which a broken one may take along."""
    findings: list[Finding] = []
    while rest := packages[len(findings) :]:
        words = [f"{one.module},{one.distribution or one.module}" for one in rest]
        command = [sys.executable, "-P", "-c", _PROBE, *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        answers = map(json.loads, done.stdout.splitlines())
        found = [Finding(one, *answer) for one, answer in zip(rest, answers, strict=False)]
        findings += found
        if len(found) < len(rest):
            died = f"importing it ends Python with exit code {done.returncode}"
            findings.append(Finding(rest[len(found)], "broken", "", died))
    return findings
