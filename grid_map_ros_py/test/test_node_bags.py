# SPDX-License-Identifier: BSD-3-Clause
"""The nodes `grid_map_loader` and `grid_map_saver` as processes."""

import sys
from pathlib import Path

import pytest
from bags import DATA, TOPIC, number_of, numbered_map

from conftest import arguments
from grid_map_core_py.testing import assert_maps_equal
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import BagError, from_message, load_from_bag, to_message
from grid_map_ros_py.testing import (
    Process,
    peer,
    refusals,
    running,
    running_node,
    start_node,
    wait_until,
)

pytestmark = pytest.mark.needs("mcap", "rosbags")

LOADER = "grid_map_ros_py._executables.grid_map_loader"
SAVER = "grid_map_ros_py._executables.grid_map_saver"
TALKATIVE = f"""
import sys
import {SAVER} as module
module.LOG_PERIOD = 0.1
sys.exit(module.GridMapSaverNode.main())
"""
WITHOUT_MCAP = """
import sys
from runpy import run_module
sys.modules.update(dict.fromkeys(("mcap", "mcap.reader", "mcap.writer", "rosbag2_py")))
run_module("grid_map_ros_py._executables.{node}", run_name="__main__")
"""


def test_loader_publishes_the_last_map_latched():
    bag = DATA / "cpp_move_sqlite"
    with running_node(LOADER, *arguments(file_path=bag, publish_topic="/loaded")) as process:
        wait_until(lambda: "publishes GridMap" in process.text, "the map to be published")
        with peer() as late:
            late.listen("/loaded", GridMapMessage)
            received = from_message(late.expect("/loaded"), unwrap=False)
    expected = load_from_bag(bag, unwrap=False)
    assert_maps_equal(received, expected)
    assert received.start_index == expected.start_index != (0, 0)


def test_loader_keeps_the_map_for_its_duration():
    given = arguments(file_path=DATA / "cpp_move_mcap", duration=20)
    with running_node(LOADER, *given), peer() as listener:
        listener.listen(TOPIC, GridMapMessage)
        listener.expect(TOPIC)
        (publisher,) = listener.node.get_publishers_info_by_topic(TOPIC)
    assert publisher.qos_profile.lifespan.nanoseconds == 20 * 10**9


@pytest.mark.parametrize(("storage", "ending"), [("mcap", ".mcap"), ("sqlite3", ".db3")])
def test_saver_saves_one_map_and_ends(tmp_path, storage, ending):
    given = {"file_path": tmp_path / "bag", "bag_topic": "/saved", "storage": storage}
    with peer() as publisher:
        saver = start_node(SAVER, *arguments(**given))
        try:
            publisher.publish(TOPIC, to_message(numbered_map(5)))
            assert saver.wait() == 0, saver.text
        finally:
            saver.stop()
    assert "saved GridMap(4 x 5 cells" in saver.text
    assert_maps_equal(load_from_bag(tmp_path / "bag" / f"bag_0{ending}", "/saved"), numbered_map(5))


@pytest.mark.parametrize("node", ["grid_map_saver", "grid_map_server", "elevation_mapping"])
def test_nodes_without_mcap_save_sqlite3_bags_and_log_why(tmp_path, node):
    given = {"file_path": tmp_path / "bag", "continuous": True}
    if node != "grid_map_saver":
        given = {"directory": tmp_path}
    program = WITHOUT_MCAP.format(node=node)
    with running(Process([sys.executable, "-c", program, *arguments(**given)])) as process:
        warning = "bags are saved as sqlite3: the package 'mcap' is not installed"
        wait_until(lambda: warning in process.text, "the warning")
        if node == "grid_map_saver":
            with peer() as publisher:
                for number in (1, 2):
                    publisher.publish(TOPIC, to_message(numbered_map(number)))
                    wait_until(lambda number=number: saved(tmp_path / "bag") == number, "the map")
            assert (tmp_path / "bag" / "bag_0.db3").exists()
        assert process.text.count(warning) == 1


def test_saver_without_mcap_refuses_mcap_at_startup(tmp_path):
    given = arguments(file_path=tmp_path / "bag", storage="mcap")
    missing = ["mcap", "mcap.reader", "mcap.writer", "rosbag2_py"]
    (text,) = refusals([(f"{SAVER}:GridMapSaverNode.main", given)], missing=missing)
    assert f"the bag {tmp_path}/bag needs the package 'mcap'" in text
    assert "/proc/" not in text


def saved(bag: Path) -> int:
    try:
        return number_of(load_from_bag(bag, TOPIC))
    except BagError:
        return 0


def test_continuous_saver_saves_every_map_and_drops_invalid_messages(tmp_path):
    bag = tmp_path / "bag"
    given = arguments(file_path=bag, continuous=True, compression="zstd")
    wrong = to_message(numbered_map(2))
    wrong.layers = ["elevation"]
    process = Process([sys.executable, "-c", TALKATIVE, *given])
    with running(process) as saver, peer() as publisher:
        publisher.publish(TOPIC, to_message(numbered_map(1)))
        wait_until(lambda: saved(bag) == 1, "the first map")
        publisher.publish(TOPIC, wrong)
        wait_until(
            lambda: "dropped a message of /grid_map: data: expected 1" in saver.text, "the error"
        )
        publisher.publish(TOPIC, to_message(numbered_map(3)))
        wait_until(lambda: saved(bag) == 3, "the third map")
        wait_until(lambda: "more maps saved: 1\n" in saver.text, "the number of maps")
        assert saver.text.count("saved GridMap") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]
