# SPDX-License-Identifier: BSD-3-Clause
"""Signals end every executable; `interrupts.py --count 2000` tries more moments."""

import itertools

import interrupts
from diagnostic_msgs.msg import DiagnosticArray

from grid_map_ros_py.testing import Process, peer, wait_until


def test_signals_end_every_executable_in_order():
    one_round = itertools.islice(interrupts.trials(seed=9), len(interrupts.executables()))
    outcomes = [*interrupts.outcomes(one_round, jobs=4)]
    faults = [f"{trial}, {phase}: {fault}" for trial, phase, fault in outcomes if fault]
    assert not faults, "\n".join(faults)
    assert {phase for _, phase, _ in outcomes} >= {"starts", "runs"}


EXECUTABLES = {
    "elevation_mapping": "elevation_mapping",
    "grid_map_filters": "filter_chain",
    "grid_map_server": "grid_map_server",
    "grid_map_visualization": "grid_map_visualization",
    "grid_map_window": "grid_map_window",
    "point_cloud_to_grid_map": "point_cloud_to_grid_map",
}
"""Executables of nodes, by the names of the nodes."""


def test_nodes_take_messages_while_they_are_interrupted(tmp_path):
    known = {executable.name: executable for executable in interrupts.executables()}
    processes: dict[str, Process] = {}

    def note(message: DiagnosticArray) -> None:
        for status in message.status:
            counts = [int(pair.value) for pair in status.values if pair.key.endswith(" out")]
            name = status.name.partition(":")[0]
            if any(counts) and name in processes:
                processes.pop(name).stop()

    with interrupts.disturbed() as data, peer() as other:
        other.node.create_subscription(DiagnosticArray, "/diagnostics", note, 10)
        try:
            for name, executable in EXECUTABLES.items():
                words = known[executable].arguments.format(folder=tmp_path, data=data).split()
                processes[name] = Process([str(known[executable].path), *words])
            wait_until(
                lambda: not processes,
                "maps out of all nodes",
                step=lambda: other.spin(0.1),
                timeout=80,  # Earlier than that of pytest, which would leave the processes.
            )
        finally:
            for process in processes.values():
                process.stop()
