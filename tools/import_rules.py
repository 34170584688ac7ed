# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The import rules that go by a module's name, as a contract for import-linter."""

from grimp import ImportGraph
from importlinter import Contract, ContractCheck, fields, output


class NodesAreLeaves(Contract):
    """Only nodes and the listed helpers import rclpy; nobody imports a node or another leaf."""

    rclpy_helpers = fields.SetField(subfield=fields.StringField())
    other_leaves = fields.SetField(subfield=fields.StringField())

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:  # noqa: ARG002
        broken = [
            f"{name} imports rclpy, but is neither a node nor listed as a helper"
            for name in importers(graph, "rclpy")
            if not is_node(name) and name not in self.rclpy_helpers
        ] + [
            f"{name} imports {leaf}, which is for nobody to import"
            for leaf in sorted({*filter(is_node, graph.modules), *self.other_leaves})
            for name in importers(graph, leaf)
        ]
        return ContractCheck(kept=not broken, metadata={"broken": broken})

    def render_broken_contract(self, check: ContractCheck) -> None:
        for line in check.metadata["broken"]:
            output.print_error(line)


def importers(graph: ImportGraph, module: str) -> list[str]:
    known = module in graph.modules
    return sorted(graph.find_modules_that_directly_import(module)) if known else []


def is_node(module: str) -> bool:
    return module.endswith("_node")
