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
    # In the round of this seed, a signal comes while elevation_mapping compiles.
    one_round = [*itertools.islice(interrupts.trials(seed=9), len(interrupts.executables()))]
    assert "elevation_mapping" in {each.executable.name for each in one_round if each.compiles}
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
                processes.pop(name).kill()

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
                process.kill()
