# SPDX-License-Identifier: BSD-3-Clause
"""Show versions, missing or broken packages, and the settings of ROS and DDS."""

import argparse
import json
import os
import platform
import subprocess
import sys

from ..errors import ros_package
from ._arguments import add_json
from ._output import print_json, print_table

_BUILD = "build and source the workspace, or pip install it"
_SOURCE = "source ROS 2, then the workspace"

PACKAGES = {
    "numpy": ("arrays", "apt install python3-numpy"),
    "scipy": ("distances and interpolation", "apt install python3-scipy"),
    "cv2": ("images", "apt install python3-opencv"),
    "yaml": ("parameter files", "apt install python3-yaml"),
    "grid_map_core_py": ("maps and their files", _BUILD),
    "lark": ("expressions of filters", "apt install python3-lark"),
    "grid_map_filters_py": ("filters", _BUILD),
    "grid_map_ros_py": ("bags, octomaps and conversions", _BUILD),
    "grid_map_visualization_py": ("pictures, and displays of RViz", _BUILD),
    "grid_map_msgs.msg": ("topics of maps", _BUILD),
    "rclpy": ("nodes", _SOURCE),
    "sensor_msgs.msg": ("messages", _SOURCE),
    "lz4": ("bags compressed with lz4", "apt install python3-lz4"),
    "zstandard": ("bags compressed with zstd", "apt install python3-zstandard"),
    "matplotlib": ("pictures and color maps", "apt install python3-matplotlib"),
    "viser": ("maps in the browser", "pip install viser"),
    "rerun": ("recordings in Rerun", "pip install rerun-sdk"),
    "rasterio": ("GeoTIFF", "pip install rasterio"),
    "pyproj": ("latitudes and longitudes", "pip install pyproj"),
    "xarray": ("datasets of xarray", "pip install xarray"),
    "dask": ("maps larger than memory", "pip install 'dask[array]'"),
    "distributed": ("maps on several machines", "pip install distributed"),
    "zarr": ("Zarr stores", "pip install zarr"),
    "trimesh": ("PLY, OBJ and STL files", "pip install trimesh"),
    "pypcd4": ("PCD files", "pip install pypcd4"),
    "numba": ("faster filters", "pip install numba"),
    "argcomplete": ("completion in the shell", "apt install python3-argcomplete"),
    "octomap_msgs.msg": ("octomaps of topics", f"apt install {ros_package('octomap_msgs')}"),
    "nav2_msgs.msg": ("costmaps of nav2", f"apt install {ros_package('nav2_msgs')}"),
    "tf2_ros": ("clouds in other frames", f"apt install {ros_package('tf2_ros_py')}"),
}
"""Purpose and installation command of each module."""

REQUIRED = ("numpy", "scipy", "cv2", "yaml", "grid_map_core_py")

_PROBE = """
import sys

# Files of the current folder are no modules. Before Python 3.11, there is no option -P.
sys.path[:1] == [""] and sys.path.pop(0)

import importlib, importlib.metadata, json, os

answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
owners = importlib.metadata.packages_distributions()
for module in sys.argv[1:]:
    status, text = "ok", ""
    top = module.partition(".")[0]
    try:
        loaded = importlib.import_module(module)
        text = str(getattr(loaded, "__version__", ""))
        text = text or importlib.metadata.version(owners.get(top, [top])[0])
    except importlib.metadata.PackageNotFoundError:
        pass
    except BaseException as error:
        is_missing = isinstance(error, ImportError) and module.startswith(error.name or module)
        status, text = ("missing", "") if is_missing else ("broken", " ".join(str(error).split()))
    print(json.dumps([status, text]), file=answers, flush=True)
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    packages = examined([*PACKAGES])
    failures = [
        name
        for name, (status, _) in packages.items()
        if status == "broken" or (status == "missing" and name in REQUIRED)
    ]
    beginnings = ("ROS_", "RMW_", "FASTRTPS_", "FASTDDS_", "CYCLONEDDS_", "AMENT_PREFIX_PATH")
    settings = sorted(pair for pair in os.environ.items() if pair[0].startswith(beginnings))
    version = platform.python_version()
    if options.json:
        keys = "status", "text", "gives", "remedy"
        print_json(
            {
                "ok": not failures,
                "python": {"version": version, "executable": sys.executable},
                "packages": {
                    name: dict(zip(keys, (*found, *PACKAGES[name]), strict=True))
                    for name, found in packages.items()
                },
                "settings": dict(settings),
            }
        )
        return bool(failures)
    print(f"Python {version} at {sys.executable}")
    rows = []
    for name, (status, text) in packages.items():
        gives, remedy = PACKAGES[name]
        advice = f"{gives} ({remedy}){': ' if text else ''}{text}"
        rows.append((status, name, text if status == "ok" else advice))
    print_table(rows)
    print_table([("", *pair) for pair in settings] or [("no ROS settings",)])
    print(f"To repair: {', '.join(failures)}" if failures else "All that is installed works.")
    return bool(failures)


def examined(modules: list[str]) -> dict[str, tuple[str, str]]:
    """Return the status ("ok", "missing" or "broken") of each module, and its version or error.

    A separate process imports the modules, because importing a broken module may end the process.
    """
    found: dict[str, tuple[str, str]] = {}
    while rest := modules[len(found) :]:
        command = [sys.executable, "-c", _PROBE, *rest]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        answers = [json.loads(line) for line in done.stdout.splitlines()]
        found |= {name: (*answer,) for name, answer in zip(rest, answers, strict=False)}
        if len(answers) < len(rest):
            died = f"importing it ends Python with exit code {done.returncode}"
            found[rest[len(answers)]] = ("broken", died)
    return found
