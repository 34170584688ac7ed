# SPDX-License-Identifier: BSD-3-Clause
import shlex
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import setuptools
from setuptools import find_packages, setup

PACKAGE = "grid_map_core_py"
URL = "https://github.com/grid-map-py/grid_map_py"
README = Path(__file__).resolve().with_name("README.md").read_text(encoding="utf-8")

key = "license_expression" if int(setuptools.__version__.partition(".")[0]) >= 77 else "license"
options = {}
programs = []
scripts = ["grid-map = grid_map_core_py.__main__:main"]
requirements = ["numpy>=1.26", "opencv-python-headless>=4.6", "PyYAML>=6.0", "scipy>=1.11"]
if {"develop", "install"} & set(sys.argv):
    # Under colcon, rosdep installs the dependencies in package.xml from apt.
    requirements = []
    # colcon puts scripts into a folder that is not on the PATH.
    programs = [("bin", ["scripts/grid-map"])]
    scripts = ["grid_map = grid_map_core_py.__main__:main"]
    # Ctrl-C waits until `__main__`; Python would print a traceback while it starts.
    python = f"/usr/bin/env -S --block-signal=INT {shlex.quote(sys.executable)}"
    options = {"build_scripts": {"executable": python}}
else:
    # pip and build create no files among the sources.
    scratch = TemporaryDirectory()
    options = {"build": {"build_base": scratch.name}, "egg_info": {"egg_base": scratch.name}}

setup(
    name=PACKAGE,
    version="0.2.0",
    description="Layered 2-D grid maps for robots in NumPy, without ROS.",
    long_description=README.replace("](../", f"]({URL}/blob/main/"),
    long_description_content_type="text/markdown",
    url=URL,
    project_urls={
        "Documentation": f"{URL}/tree/main/docs",
        "Changelog": f"{URL}/blob/main/{PACKAGE}/CHANGELOG.rst",
        "Issues": f"{URL}/issues",
    },
    keywords=["grid map", "elevation map", "terrain", "robotics", "mapping"],
    classifiers=[
        "Development Status :: 5 - Production/Stable",
        "Intended Audience :: Science/Research",
        "Programming Language :: Python :: 3",
        "Topic :: Scientific/Engineering",
        "Typing :: Typed",
    ],
    maintainer="grid_map_py contributors",
    maintainer_email="grid-map-py@users.noreply.github.com",
    license_files=["LICENSE"],
    **{key: "BSD-3-Clause"},
    options=options,
    python_requires=">=3.10",
    packages=find_packages(exclude=["test"]),
    package_data={"": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        *programs,
    ],
    install_requires=requirements,
    extras_require={
        "completion": ["argcomplete>=3"],
        "fast": ["numba>=0.59"],
        "files": ["pypcd4>=1.1", "trimesh>=4.8"],
        "geo": ["pyproj>=3.6.1", "rasterio>=1.3.9"],
        "test": ["pytest"],
        "tiled": [
            "dask[array]>=2023.12.1",
            "distributed>=2023.12.1",
            "numcodecs>=0.12.1",
            "xarray>=2023.12.0",
            "zarr>=2.17.0",
        ],
        "xarray": ["xarray>=2023.12.0"],
    },
    entry_points={
        "console_scripts": scripts,
        "grid_map_core_py.formats": ["zarr = grid_map_core_py.tiled._open:ZARR"],
    },
)
