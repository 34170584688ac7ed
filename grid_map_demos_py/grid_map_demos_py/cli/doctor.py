# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`grid-map doctor`: what is installed, what is missing, and how ROS is set."""

import argparse
import platform
import sys

from .arguments import add_json
from .doctor_packages import Finding, examined, is_failure, ros_is_wanted
from .doctor_settings import Setting, settings
from .output import print_json, print_table

HELP = "check what is installed, what is missing, and how ROS and DDS are set"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what `run` needs."""
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Print what was found; return 1 if something that is required does not work."""
    packages = examined()
    with_ros = ros_is_wanted(packages)
    found = settings(with_ros=with_ros)
    failures = [one.package.module for one in packages if is_failure(one, with_ros=with_ros)]
    failures += [one.name for one in found if one.status == "broken"]
    python = {"version": platform.python_version(), "executable": sys.executable}
    if options.json:
        lists = {
            "packages": [one.as_dict() for one in packages],
            "settings": [one.as_dict() for one in found],
        }
        print_json({"ok": not failures, "python": python, **lists})
    else:
        print(f"Python {python['version']} at {python['executable']}")
        _print(packages, found)
        print(
            f"\nTo repair: {', '.join(failures)}" if failures else "\nAll that is required works."
        )
    return 1 if failures else 0


def _print(packages: list[Finding], found: list[Setting]) -> None:
    for group in dict.fromkeys(one.package.group for one in packages):
        print(f"\n{group}")
        members = [one for one in packages if one.package.group == group]
        print_table([("", one.status, one.package.module, one.text) for one in members])
    print("\nsettings")
    print_table([("", one.status, one.name, one.text) for one in found])
