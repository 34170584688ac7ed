# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Large maps between processes, with the profile that comes with this package."""

import json
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from conftest import NODES
from grid_map_ros_py.testing import Process, running, wait_until

PROFILE = Path(__file__).parents[1] / "config" / "fastdds_large_maps.xml"
NAMESPACE = "{http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles}"


def start(role: str) -> Process:
    command = [sys.executable, str(NODES / "large_maps.py"), role]
    return Process(command, {"FASTRTPS_DEFAULT_PROFILES_FILE": str(PROFILE)})


def test_no_large_map_is_lost_with_the_profile() -> None:
    with running(start("receive")) as receiver, running(start("send")) as sender:
        wait_until(lambda: len(receiver.lines) == 5, "all five maps")
        wait_until(lambda: sender.lines, "the sender to say so")
    assert [json.loads(line) for line in receiver.lines] == [[k, 8, 1000, 1000] for k in range(5)]
    # The profile is applied, not ignored.
    assert json.loads(sender.lines[0])["largest segment"] >= segment_size()


def segment_size() -> int:
    size = ElementTree.parse(PROFILE).find(f".//{NAMESPACE}segment_size")
    assert size is not None
    return int(str(size.text))
