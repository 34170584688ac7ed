# SPDX-License-Identifier: BSD-3-Clause
"""`grid-map doctor`."""

import json
import sys

import pytest

from grid_map_core_py import _packages
from grid_map_core_py._commands import doctor, main
from grid_map_core_py._packages import Package, remedy_for


def test_healthy_machine_has_no_failures(capfd, monkeypatch):
    # The page on the command line examines all of them, which takes seconds.
    monkeypatch.setattr(doctor, "PACKAGES", {"numpy": Package("arrays"), "yaml": Package("x")})
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    code = main(["doctor", "--json"])
    found = json.loads(capfd.readouterr().out)
    assert (code, found["ok"]) == (0, True)
    assert found["python"]["executable"] == sys.executable
    assert found["packages"].keys() == doctor.PACKAGES.keys()
    numpy = found["packages"]["numpy"]
    assert (numpy["status"], numpy["gives"]) == ("ok", "arrays")
    assert numpy["remedy"] == remedy_for("numpy")
    assert numpy["text"].count(".") >= 1
    assert found["settings"]["ROS_DOMAIN_ID"] == "7"


def test_failures_are_listed_last_and_in_the_exit_code(capfd, monkeypatch):
    monkeypatch.setattr(doctor, "PACKAGES", {"numpy": Package("arrays"), "nothing": Package("x")})
    assert main(["doctor"]) == 0
    text = capfd.readouterr().out
    assert "missing  nothing  x (" in text
    assert text.endswith("All that is installed works.\n")
    monkeypatch.setattr(doctor, "REQUIRED", ("nothing",))
    assert main(["doctor"]) == 1
    assert capfd.readouterr().out.endswith("To repair: nothing\n")


def test_modules_that_break_or_end_python_are_broken(tmp_path, monkeypatch):
    (tmp_path / "breaks.py").write_text("print('hello')\nraise OSError('no library')\n")
    (tmp_path / "needs.py").write_text("import that_is_not_there\n")
    (tmp_path / "dies.py").write_text("import os\nos._exit(7)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=":")
    names = ["json", "breaks", "is_not_there", "dies", "needs", "is_not_there.msg"]
    found = doctor.examined(names)
    assert [*found] == names
    statuses = ["ok", "broken", "missing", "broken", "broken", "missing"]
    assert [status for status, _ in found.values()] == statuses
    assert found["breaks"][1] == "no library"
    assert found["dies"][1] == "importing it ends Python with exit code 7"
    assert "that_is_not_there" in found["needs"][1]


@pytest.mark.parametrize(
    ("module", "anywhere", "where_pip_is_refused"),
    [
        (
            "rasterio.crs",
            "apt install python3-rasterio, or pip install rasterio",
            "apt install python3-rasterio",
        ),
        (
            "viser",
            "pip install viser",
            "python3 -m venv --system-site-packages venv && venv/bin/pip install viser",
        ),
        ("nav_msgs.srv", "apt install ros-jazzy-nav-msgs", "apt install ros-jazzy-nav-msgs"),
        ("grid_map_ros_py", "build and source the workspace", "build and source the workspace"),
    ],
)
def test_remedy_works_where_pip_is_refused(module, anywhere, where_pip_is_refused, monkeypatch):
    monkeypatch.setattr(_packages, "_is_managed", lambda: False)
    assert remedy_for(module).startswith(anywhere)
    monkeypatch.setattr(_packages, "_is_managed", lambda: True)
    assert remedy_for(module).startswith(where_pip_is_refused)
