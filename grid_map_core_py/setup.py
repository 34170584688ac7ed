# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
from setuptools import find_packages, setup

PACKAGE = "grid_map_core_py"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Layered 2-D grid maps for robots in NumPy, without ROS.",
    maintainer="grid_map_py contributors",
    maintainer_email="grid-map-py@users.noreply.github.com",
    license="BSD-3-Clause",
    packages=find_packages(exclude=["test"]),
    package_data={"": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    tests_require=["pytest"],
    extras_require={"files": ["pypcd4>=1.1", "trimesh>=4.8"], "test": ["pytest"]},
    zip_safe=True,
)
