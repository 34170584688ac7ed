# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
from glob import glob

from setuptools import find_packages, setup

PACKAGE = "grid_map_ros_py"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Conversions between grid maps and ROS 2 messages.",
    maintainer="grid_map_py contributors",
    maintainer_email="grid-map-py@users.noreply.github.com",
    license="BSD-3-Clause",
    packages=find_packages(exclude=["test"]),
    package_data={"": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/config", glob("config/*")),
    ],
    install_requires=["setuptools"],
    tests_require=["pytest"],
    extras_require={"test": ["pytest"]},
    zip_safe=True,
    entry_points={
        "console_scripts": [
            "grid_map_loader = grid_map_ros_py._executables.grid_map_loader:main",
            "grid_map_saver = grid_map_ros_py._executables.grid_map_saver:main",
            "grid_map_server = grid_map_ros_py._executables.grid_map_server:main",
            "octomap_to_grid_map = grid_map_ros_py._executables.octomap_to_grid_map:main",
            "point_cloud_to_grid_map = grid_map_ros_py._executables.point_cloud_to_grid_map:main",
        ],
    },
)
