# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Signals end every executable; `interrupts.py --count 2000` tries more moments."""

import itertools
import signal

import interrupts
import pytest
from diagnostic_msgs.msg import DiagnosticArray

from grid_map_ros_py.testing import Process, peer, wait_until

ENDS = {
    "exit 0": "",
    "exit 3": "exit code 3",
    "echo Traceback": "exit code 0",
    "sleep 60 >&2 &": "leaves a process",
    "touch $HOME/map.npz.part": "leaves map.npz.part",
    "trap '' TERM; sleep 60; sleep 60": "hangs",
}
"""Scripts, and what is wrong with their ends."""


def test_signals_end_every_executable_in_order():
    one_round = itertools.islice(interrupts.trials(seed=1), len(interrupts.executables()))
    outcomes = [*interrupts.outcomes(one_round, jobs=4)]
    faults = [f"{trial}, {phase}: {fault}" for trial, phase, fault in outcomes if fault]
    assert not faults, "\n".join(faults)
    phases = {phase for _, phase, _ in outcomes}
    # Importing is short.
    assert "runs" in phases
    assert phases & {"Python starts", "imports"}


@pytest.mark.parametrize(("script", "expected"), ENDS.items())
def test_wrong_end_of_executable_is_found(script, expected, tmp_path, monkeypatch):
    monkeypatch.setattr(interrupts, "PATIENCE", 1.0)
    monkeypatch.setattr(interrupts, "stacks", interrupts.listed)
    path = tmp_path / "executable"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    executable = interrupts.Executable(path)
    trial = interrupts.Trial(0, executable, "itself", False, signal.SIGTERM, False, [0.5])
    _, fault = interrupts.carry_out(trial, data="")
    assert fault.startswith(expected)
    assert bool(fault) == bool(expected), fault


def test_nodes_take_messages_while_they_are_interrupted(tmp_path):
    names = ("elevation_mapping", "filter_chain", "grid_map_server", "grid_map_visualization")
    names += ("grid_map_window", "point_cloud_to_grid_map")
    nodes = {node.name: node for node in interrupts.executables()}
    taken: dict[str, int] = {}

    def note(message: DiagnosticArray) -> None:
        for status in message.status:
            counts = [int(pair.value) for pair in status.values if pair.key.endswith(" out")]
            taken[status.name.partition(":")[0]] = sum(counts)

    with interrupts.disturbed() as data, peer() as other:
        other.node.create_subscription(DiagnosticArray, "/diagnostics", note, 10)
        processes = []
        for name in names:
            words = nodes[name].arguments.format(folder=tmp_path, data=data).split()
            processes.append(Process([str(nodes[name].path), *words]))
        try:
            wait_until(
                lambda: len(taken) == len(names) and all(taken.values()),
                f"maps out of {names}",
                step=lambda: other.spin(0.1),
                timeout=80,  # Earlier than that of pytest, which would leave the processes.
            )
        finally:
            for process in processes:
                process.kill()
