# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Findings of the doctor on complete, broken and ROS-free machines."""

import json
from pathlib import Path

import pytest
from command_line import grid_map

from grid_map_demos_py.cli import doctor_settings
from grid_map_demos_py.cli.doctor_packages import (
    Finding,
    Package,
    examined,
    is_failure,
    ros_is_wanted,
)
from grid_map_demos_py.cli.doctor_settings import settings
from grid_map_demos_py.cli.main import main

HEALTHY = {"ROS_DOMAIN_ID": "7", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def package(module: str, group: str = "optional") -> Package:
    return Package(module, group, "something", "install it")


def test_a_machine_that_is_well(monkeypatch, capfd):
    for name, value in HEALTHY.items():
        monkeypatch.setenv(name, value)
    code = main(["doctor", "--json"])
    found = json.loads(capfd.readouterr().out)
    assert (code, found["ok"]) == (0, True), found
    assert found.keys() == {"ok", "python", "packages", "settings"}
    for one in found["packages"]:
        keys = {"module", "group", "gives", "remedy", "status", "version", "error"}
        assert one.keys() == keys
        assert one["group"] == "optional" or one["status"] == "ok", one
    numpy = next(one for one in found["packages"] if one["module"] == "numpy")
    assert numpy["version"].count(".") >= 1
    named = {one["name"]: one for one in found["settings"]}
    assert named["ROS_DOMAIN_ID"] == {
        "name": "ROS_DOMAIN_ID",
        "value": "7",
        "status": "ok",
        "note": "",
    }
    assert "/dev/shm" in named


def test_a_machine_that_is_ill(tmp_path):
    environ = {**HEALTHY, "ROS_DOMAIN_ID": "900", "FASTRTPS_DEFAULT_PROFILES_FILE": "/none.xml"}
    done = grid_map("doctor", cwd=tmp_path, environ=environ)
    assert done.returncode == 1
    text = done.stdout.decode()
    assert text.endswith("To repair: ROS_DOMAIN_ID, FASTRTPS_DEFAULT_PROFILES_FILE\n")
    assert "expected a number from 0 to 232" in text
    assert done.stderr == b""


@pytest.mark.parametrize(
    ("name", "value", "status"),
    [
        ("ROS_DOMAIN_ID", "", "ok"),
        ("ROS_DOMAIN_ID", "150", "warning"),
        ("ROS_DOMAIN_ID", "-1", "broken"),
        ("ROS_DOMAIN_ID", "seven", "broken"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET", "ok"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF", "warning"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "EVERYWHERE", "warning"),
        ("ROS_LOCALHOST_ONLY", "1", "warning"),
        ("RMW_IMPLEMENTATION", "rmw_of_nobody", "broken"),
        ("ROS_DISTRO", "humble", "warning"),
        ("FASTRTPS_DEFAULT_PROFILES_FILE", __file__, "broken"),
        ("AMENT_PREFIX_PATH", "/nowhere", "warning"),
        ("FASTDDS_BUILTIN_TRANSPORTS", "LARGE_DATA", "ok"),
        ("FASTDDS_BUILTIN_TRANSPORTS", "LARGE_DATA?max_msg_size=1MB", "ok"),
        ("FASTDDS_BUILTIN_TRANSPORTS", "LARGEDATA", "warning"),
    ],
)
def test_settings_are_judged(name, value, status, monkeypatch):
    monkeypatch.setenv(name, value)
    (found,) = (one for one in settings(with_ros=True) if one.name == name)
    assert found.status == status, found


def test_a_profile_that_is_xml_is_fine(monkeypatch, tmp_path):
    (tmp_path / "profile.xml").write_text("<dds/>")
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(tmp_path / "profile.xml"))
    (found,) = (one for one in settings(with_ros=True) if "PROFILES" in one.name)
    assert found.status == "ok"


def test_shared_memory_that_is_missing_or_full_is_a_warning(monkeypatch, tmp_path):
    monkeypatch.setattr(doctor_settings, "_SHARED_MEMORY", tmp_path / "none")
    missing = settings(with_ros=True)
    monkeypatch.setattr(doctor_settings, "_SHARED_MEMORY", tmp_path)
    monkeypatch.setattr(doctor_settings, "_SEGMENT", 2**62)
    full = settings(with_ros=True)
    for found in (missing, full):
        (memory,) = (one for one in found if one.name.startswith(str(tmp_path)))
        assert memory.status == "warning"


def test_without_ros_there_is_nothing_to_say_of_its_settings(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "nonsense")
    assert [one.name for one in settings(with_ros=False)] == ["grid-map"]


def test_packages_that_are_missing_break_or_take_python_along(tmp_path, monkeypatch):
    (tmp_path / "breaks.py").write_text("print('hello')\nraise OSError('no library')\n")
    (tmp_path / "needs.py").write_text("import that_is_not_there\n")
    (tmp_path / "dies.py").write_text("import os\nos._exit(7)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=":")
    names = ("json", "breaks", "is_not_there", "dies", "needs", "is_not_there.msg")
    found = examined(tuple(map(package, names)))
    assert [one.package.module for one in found] == [*names]
    statuses = ["ok", "broken", "missing", "broken", "broken", "missing"]
    assert [one.status for one in found] == statuses
    assert found[1].error == "OSError: no library"
    assert found[3].error == "importing it ends Python with exit code 7"
    assert "that_is_not_there" in found[4].error


def test_what_is_optional_may_be_missing_and_ros_where_there_is_none():
    def found(module: str, group: str, status: str) -> Finding:
        return Finding(package(module, group), status, "", "")

    assert not is_failure(found("viser", "optional", "missing"), with_ros=True)
    assert is_failure(found("numpy", "required", "missing"), with_ros=False)
    messages = found("grid_map_msgs.msg", "ROS", "missing")
    assert is_failure(messages, with_ros=True)
    assert not is_failure(messages, with_ros=False)
    assert ros_is_wanted([found("rclpy", "ROS", "broken"), messages])
    assert not ros_is_wanted([found("rclpy", "ROS", "missing"), messages])


def test_our_packages_are_all_looked_for():
    manifests = Path(__file__).parents[2].glob("grid_map_*/package.xml")
    there = {path.parent.name for path in manifests}
    assert "grid_map_demos_py" in there
    assert there <= {*doctor_settings.OUR_PACKAGES}
