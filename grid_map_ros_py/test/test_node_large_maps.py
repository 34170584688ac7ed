# SPDX-License-Identifier: BSD-3-Clause
"""Large maps and clouds between processes, with and without the profile of this package."""

import json
import os
import sys
import xml.etree.ElementTree as ElementTree

import pytest

from conftest import NODES
from grid_map_ros_py.nodes._profile import PROFILE, use_profile
from grid_map_ros_py.testing import Process, running, running_node, wait_until

NAMESPACE = "{http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles}"
VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"


def start(role: str, profile: str = "") -> Process:
    """Start a script; by default without the profile of these tests, as a user would."""
    return Process([sys.executable, str(NODES / "large_maps.py"), role], {VARIABLE: profile})


def test_no_large_map_is_lost() -> None:
    with running(start("receive")) as receiver, running(start("send")) as sender:
        wait_until(lambda: len(receiver.lines) == 5, "all five maps")
        wait_until(lambda: sender.lines, "the sender to say so")
    assert [*map(json.loads, receiver.lines)] == [[k, 9, 1000, 1000] for k in range(5)]
    # The profile is applied, not ignored.
    size = ElementTree.parse(PROFILE).find(f".//{NAMESPACE}segment_size")
    assert size is not None
    assert json.loads(sender.lines[0])["largest segment"] >= int(str(size.text))


def test_lost_clouds_are_logged_once() -> None:
    with (
        running_node("grid_map_ros_py._executables.point_cloud_to_grid_map") as node,
        running(start("send clouds", os.environ[VARIABLE])) as sender,
    ):
        wait_until(lambda: "sent" in sender.text, "the clouds")
        wait_until(lambda: "messages of /points get lost" in node.text, "a warning")
    assert node.text.count("messages of /points get lost") == 1


VERSIONS = [VARIABLE, "FASTDDS_DEFAULT_PROFILES_FILE"]
"""The variables of Fast DDS 2 and 3."""


@pytest.mark.parametrize("chosen", ["", "FASTDDS_BUILTIN_TRANSPORTS", *VERSIONS])
def test_profile_serves_all_versions_unless_the_user_chooses(
    monkeypatch: pytest.MonkeyPatch, chosen: str
) -> None:
    # `setenv` registers the variables to be restored.
    for name in ("FASTDDS_BUILTIN_TRANSPORTS", *VERSIONS):
        monkeypatch.setenv(name, "mine" if name == chosen else "")
    use_profile()
    expected = ["mine" if name == chosen else "" if chosen else str(PROFILE) for name in VERSIONS]
    assert [os.environ[name] for name in VERSIONS] == expected


def test_small_shared_memory_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE)
    monkeypatch.setattr("grid_map_ros_py.nodes._profile.SHARED_MEMORY", 2**62)
    use_profile()
    assert VARIABLE not in os.environ
