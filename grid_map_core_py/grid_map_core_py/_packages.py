# SPDX-License-Identifier: BSD-3-Clause
"""Packages that the suite uses, with their purposes and installation commands."""

import os
import sys
from pathlib import Path
from typing import NamedTuple

_DISTRIBUTION = os.environ.get("ROS_DISTRO", "jazzy")
_WORKSPACE = "build and source the workspace, or pip install it"


class Package(NamedTuple):
    gives: str
    apt: str = ""
    """Name of the package on Ubuntu 24.04; "*" stands for the ROS distribution."""
    pip: str = ""


PACKAGES = {
    "numpy": Package("arrays", "python3-numpy", "numpy"),
    "scipy": Package("distances, interpolation and paths", "python3-scipy", "scipy"),
    "cv2": Package("images", "python3-opencv", "opencv-python-headless"),
    "yaml": Package("parameter files", "python3-yaml", "PyYAML"),
    "grid_map_core_py": Package("maps and map files"),
    "lark": Package("expressions in filters", "python3-lark", "lark"),
    "grid_map_filters_py": Package("filters"),
    "grid_map_ros_py": Package("bags, octomaps and conversions"),
    "grid_map_visualization_py": Package("pictures and RViz displays"),
    "grid_map_msgs.msg": Package("map topics", "ros-*-grid-map-msgs"),
    "rclpy": Package("nodes", "ros-*-rclpy"),
    "sensor_msgs.msg": Package("messages", "ros-*-sensor-msgs"),
    "mcap": Package("MCAP bags without ROS", "", "mcap"),
    "zstandard": Package("bags with zstd compression", "python3-zstandard", "zstandard"),
    "matplotlib": Package("pictures and color maps", "python3-matplotlib", "matplotlib"),
    "viser": Package("maps in the browser", "", "viser"),
    "rerun": Package("recordings in Rerun", "", "rerun-sdk"),
    "rasterio": Package("GeoTIFF files", "python3-rasterio", "rasterio"),
    "pyproj": Package("latitude and longitude", "python3-pyproj", "pyproj"),
    "xarray": Package("xarray datasets", "python3-xarray", "xarray"),
    "dask": Package("maps larger than memory", "python3-dask", "dask[array]"),
    "distributed": Package("maps on several machines", "python3-distributed", "distributed"),
    "zarr": Package("Zarr stores", "python3-zarr", "zarr"),
    "trimesh": Package("PLY, OBJ and STL files", "", "trimesh"),
    "pypcd4": Package("PCD files", "", "pypcd4"),
    "numba": Package("faster filters", "python3-numba", "numba"),
    "argcomplete": Package("shell completion", "python3-argcomplete", "argcomplete"),
    "octomap_msgs.msg": Package("octomap topics", "ros-*-octomap-msgs"),
    "nav2_msgs.msg": Package("Nav2 costmaps", "ros-*-nav2-msgs"),
    "tf2_ros": Package("poses and clouds in other frames", "ros-*-tf2-ros-py"),
}
"""Packages that the suite uses, by the name of the module to import."""


def remedy_for(module: str) -> str:
    """Return how to install the package of a module on this machine."""
    top, _, rest = module.partition(".")
    _, apt, pip = PACKAGES.get(module) or PACKAGES.get(top) or Package("")
    if rest in ("msg", "srv", "action"):
        apt = f"ros-*-{top.replace('_', '-')}"
    if top.startswith("grid_map_") and not apt:
        return _WORKSPACE
    if apt.startswith("ros-"):
        return f"apt install {apt.replace('*', _DISTRIBUTION)}, then source ROS 2 and the workspace"
    pip = pip or top
    command = f"pip install '{pip}'" if "[" in pip else f"pip install {pip}"
    if not _is_managed():
        return f"apt install {apt}, or {command}" if apt else command
    if apt:
        return f"apt install {apt}"
    # On a managed Python, pip installs packages only in a virtual environment (PEP 668).
    venv = "python3 -m venv --system-site-packages venv"
    return f"{venv} && venv/bin/{command} (see docs/installation.md)"


def _is_managed() -> bool:
    """Return whether the operating system blocks `pip install` for this Python."""
    import sysconfig

    marker = Path(sysconfig.get_path("stdlib"), "EXTERNALLY-MANAGED")
    return sys.prefix == sys.base_prefix and marker.exists()
