# SPDX-License-Identifier: BSD-3-Clause
import shlex
import sys
from glob import glob
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import setuptools
from setuptools import find_packages, setup

PACKAGE = "grid_map_visualization_py"
URL = "https://github.com/grid-map-py/grid_map_py"
README = Path(__file__).resolve().with_name("README.md").read_text(encoding="utf-8")
VERSION = ElementTree.parse(Path(__file__).resolve().with_name("package.xml")).findtext("version")

key = "license_expression" if int(setuptools.__version__.partition(".")[0]) >= 77 else "license"
options = {}
scripts = []  # `ros2 run` does not find nodes installed by pip
requirements = [f"grid_map_ros_py=={VERSION}"]
if {"develop", "install"} & set(sys.argv):
    # Under colcon, rosdep installs the dependencies in package.xml from apt.
    requirements = []
    scripts = [
        # Example: web_viewer = ..._executables.web_viewer:WebViewerNode.main
        *(
            f"{name} = {PACKAGE}._executables.{name}:{name.title().replace('_', '')}Node.main"
            for name in ("grid_map_visualization", "rerun_viewer", "web_viewer")
        ),
        "snapshot = grid_map_visualization_py._executables.snapshot:main",
    ]
    # Block Ctrl-C until `quiet_start`, because Python would print a traceback during startup.
    python = f"/usr/bin/env -S --block-signal=INT {shlex.quote(sys.executable)}"
    options = {"build_scripts": {"executable": python}}
else:
    # Keep pip and build from creating files among the sources.
    scratch = TemporaryDirectory()
    options = {"build": {"build_base": scratch.name}, "egg_info": {"egg_base": scratch.name}}

setup(
    name=PACKAGE,
    version="0.2.0",
    description="Shows grid maps as point clouds, occupancy grids and markers.",
    long_description=README.replace("](../", f"]({URL}/blob/main/"),
    long_description_content_type="text/markdown",
    url=URL,
    project_urls={
        "Documentation": f"{URL}/tree/main/docs",
        "Changelog": f"{URL}/blob/main/{PACKAGE}/CHANGELOG.rst",
        "Issues": f"{URL}/issues",
    },
    keywords=["grid map", "elevation map", "visualization", "ROS 2", "robotics"],
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
    python_requires=">=3.11",
    packages=find_packages(exclude=["test"]),
    package_data={"": ["py.typed", "settings/rerun/*.json"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/config", glob("config/*")),
    ],
    install_requires=requirements,
    extras_require={
        "pictures": ["matplotlib>=3.6"],
        "rerun": ["matplotlib>=3.6", "rerun-sdk>=0.41,<0.42"],
        "test": ["pytest"],
        "web_viewer": ["viser>=1.1"],
    },
    entry_points={
        "console_scripts": scripts,
        "grid_map_core_py.commands": [
            "plot = grid_map_visualization_py._commands.plot",
            "view = grid_map_visualization_py._commands.view",
        ],
        "grid_map_core_py.formats": ["rrd = grid_map_visualization_py._formats:RRD"],
        "grid_map_core_py.plots": [
            "flat = grid_map_visualization_py.pictures:plot",
            "surface = grid_map_visualization_py.pictures:plot_3d",
            "relief = grid_map_visualization_py.pictures:plot_relief",
        ],
    },
)
