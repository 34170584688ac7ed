# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
from setuptools import find_packages, setup

PACKAGE = "grid_map_filters_py"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Chains of grid map filters, configured in YAML.",
    maintainer="grid_map_py contributors",
    maintainer_email="grid-map-py@users.noreply.github.com",
    license="BSD-3-Clause",
    packages=find_packages(exclude=["test"]),
    package_data={"": ["py.typed", "*.lark"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    tests_require=["pytest"],
    extras_require={"test": ["pytest"]},
    zip_safe=True,
    entry_points={
        "console_scripts": [
            "filter_bag = grid_map_filters_py._executables.filter_bag:main",
            "filter_chain = grid_map_filters_py._executables.filter_chain:main",
        ],
    },
)
