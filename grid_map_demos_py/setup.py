# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
from glob import glob

from setuptools import find_packages, setup

PACKAGE = "grid_map_demos_py"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Demonstrations of the grid map packages on real terrain.",
    maintainer="grid_map_py contributors",
    maintainer_email="grid-map-py@users.noreply.github.com",
    license="BSD-3-Clause",
    packages=find_packages(exclude=["test"]),
    package_data={"": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/config", glob("config/*")),
        (f"share/{PACKAGE}/data", glob("data/*")),
        (f"share/{PACKAGE}/foxglove", glob("foxglove/*")),
        (f"share/{PACKAGE}/rviz", glob("rviz/*")),
    ],
    install_requires=["setuptools"],
    tests_require=["pytest"],
    extras_require={"test": ["pytest"]},
    zip_safe=True,
    entry_points={
        "console_scripts": [
            "demo_report = grid_map_demos_py.demo_report_node:main",
            "filters_demo = grid_map_demos_py.filters_demo:main",
            "simple_demo = grid_map_demos_py.simple_demo_node:main",
            "terrain_publisher = grid_map_demos_py.terrain_publisher_node:main",
        ],
    },
)
