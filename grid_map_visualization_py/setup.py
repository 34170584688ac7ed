# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
from glob import glob

from setuptools import find_packages, setup

PACKAGE = "grid_map_visualization_py"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Shows grid maps as point clouds, occupancy grids and markers.",
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
    extras_require={"test": ["pytest"], "web_viewer": ["viser>=1.1"]},
    zip_safe=True,
    entry_points={
        "console_scripts": [
            "grid_map_visualization = grid_map_visualization_py._executables.grid_map_visualization:main",  # noqa: E501
            "snapshot = grid_map_visualization_py._executables.snapshot:main",
            "web_viewer = grid_map_visualization_py._executables.web_viewer:main",
        ],
    },
)
