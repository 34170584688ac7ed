# SPDX-License-Identifier: BSD-3-Clause
"""Contracts for import-linter that depend on module names."""

from grimp import ImportGraph
from importlinter import Contract, ContractCheck, fields, output


class NodesAreLeaves(Contract):
    """Only executables and the listed helpers import rclpy; no module imports an executable."""

    rclpy_helpers = fields.SetField(subfield=fields.StringField())

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:  # noqa: ARG002
        broken = [
            f"{name} imports rclpy, but is neither an executable nor listed as a helper"
            for name in importers(graph, "rclpy")
            if not is_executable(name) and name not in self.rclpy_helpers
        ] + [
            f"{name} imports {leaf}, an executable"
            for leaf in sorted(filter(is_executable, graph.modules))
            for name in importers(graph, leaf)
        ]
        return ContractCheck(kept=not broken, metadata={"broken": broken})

    def render_broken_contract(self, check: ContractCheck) -> None:
        for line in check.metadata["broken"]:
            output.print_error(line)


def importers(graph: ImportGraph, module: str) -> list[str]:
    known = module in graph.modules
    return sorted(graph.find_modules_that_directly_import(module)) if known else []


def is_executable(module: str) -> bool:
    return "._executables." in module or module.endswith("_node")
