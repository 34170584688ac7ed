# SPDX-License-Identifier: BSD-3-Clause
import shlex
import sys
from glob import glob
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import setuptools
from setuptools import find_packages, setup

PACKAGE = "grid_map_demos_py"
URL = "https://github.com/grid-map-py/grid_map_py"
README = Path(__file__).resolve().with_name("README.md").read_text(encoding="utf-8")
VERSION = ElementTree.parse(Path(__file__).resolve().with_name("package.xml")).findtext("version")
NODES = (
    "elevation_mapping_robot",
    "grid_map_to_image_demo",
    "image_publisher",
    "image_to_gridmap_demo",
    "interpolation_demo",
    "large_map_robot",
    "iterators_demo",
    "move_demo",
    "normal_filter_comparison_demo",
    "octomap_to_gridmap_demo",
    "opencv_demo",
    "path_planner_robot",
    "planar_regions_robot",
    "resolution_change_demo",
    "sdf_demo",
    "simple_demo",
    "terrain_publisher",
    "tutorial_demo",
)

key = "license_expression" if int(setuptools.__version__.partition(".")[0]) >= 77 else "license"
options = {}
scripts = []  # `ros2 run` does not find nodes installed by pip
requirements = [
    f"grid_map_filters_py=={VERSION}",
    f"grid_map_visualization_py[pictures]=={VERSION}",
]
if {"develop", "install"} & set(sys.argv):
    # Under colcon, rosdep installs the dependencies in package.xml from apt.
    requirements = []
    scripts = [
        f"demo_report = {PACKAGE}.report_node:DemoReportNode.main",
        f"elevation_mapping_demo = {PACKAGE}.launcher:elevation_mapping_demo",
        f"elevation_mapping_report = {PACKAGE}.report_node:ElevationMappingReportNode.main",
        f"filters_demo = {PACKAGE}.launcher:filters_demo",
        # The name in C++.
        f"image_publisher.py = {PACKAGE}.image_publisher_node:ImagePublisherNode.main",
        f"iterator_benchmark = {PACKAGE}.iterator_benchmark:main",
        f"large_map_demo = {PACKAGE}.launcher:large_map_demo",
        f"path_planner_demo = {PACKAGE}.launcher:path_planner_demo",
        f"path_planner_report = {PACKAGE}.report_node:PathPlannerReportNode.main",
        f"planar_regions_demo = {PACKAGE}.launcher:planar_regions_demo",
        f"planar_regions_report = {PACKAGE}.report_node:PlanarRegionsReportNode.main",
        f"large_map_report = {PACKAGE}.report_node:LargeMapReportNode.main",
        *(
            # Example: move_demo = grid_map_demos_py.move_demo_node:MoveDemoNode.main
            f"{name} = {PACKAGE}.{name}_node:{name.title().replace('_', '')}Node.main"
            for name in NODES
        ),
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
    description="Demonstrations of the grid map packages on real terrain.",
    long_description=README.replace("](../", f"]({URL}/blob/main/"),
    long_description_content_type="text/markdown",
    url=URL,
    project_urls={
        "Documentation": f"{URL}/tree/main/docs",
        "Changelog": f"{URL}/blob/main/{PACKAGE}/CHANGELOG.rst",
        "Issues": f"{URL}/issues",
    },
    keywords=["grid map", "elevation map", "demos", "ROS 2", "robotics"],
    classifiers=[
        "Development Status :: 5 - Production/Stable",
        "Intended Audience :: Science/Research",
        "Programming Language :: Python :: 3",
        "Topic :: Scientific/Engineering",
        "Typing :: Typed",
    ],
    maintainer="grid_map_py contributors",
    maintainer_email="grid-map-py@users.noreply.github.com",
    license_files=["LICENSE", "NOTICE"],
    **{key: "BSD-3-Clause"},
    options=options,
    python_requires=">=3.11",
    packages=find_packages(exclude=["test"]),
    package_data={"": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml", "NOTICE"]),
        (f"share/{PACKAGE}/config", glob("config/*")),
        (f"share/{PACKAGE}/data", glob("data/*")),
        (f"share/{PACKAGE}/foxglove", glob("foxglove/*")),
        (f"share/{PACKAGE}/launch", glob("launch/*")),
        (f"share/{PACKAGE}/rviz", glob("rviz/*")),
    ],
    install_requires=requirements,
    extras_require={"test": ["pytest"]},
    entry_points={
        "console_scripts": scripts,
    },
)
