# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Print the parameters that a node reads, then what is declared, and spin."""

import json
import sys

from rclpy.node import Node

from grid_map_ros_py.nodes import read_parameter, read_parameter_tree, run


class Configured(Node):
    def __init__(self) -> None:
        super().__init__("configured")
        prefix = read_parameter(self, "filter_chain_parameter_name", str, "filters")
        described = {
            "tree": read_parameter_tree(self, prefix, description="what runs"),
            "rate": read_parameter(self, "rate", float, 2.0, description="how often"),
            "color": read_parameter(self, "color", int, 0),
            "names": read_parameter(self, "names", list[str], ["default"]),
            "frame_id": read_parameter(self, "frame_id", str),
            "declared": {
                name: str(parameter.type_).removeprefix("Type.")
                for name, parameter in self.get_parameters_by_prefix("").items()
                if name != "use_sim_time" and not name.startswith("start_type")
            },
            "descriptions": {
                name: self.describe_parameter(name).description
                for name in ("rate", "color", f"{prefix}.filter1.name")
                if self.has_parameter(name)
            },
        }
        print(json.dumps(described), flush=True)


if __name__ == "__main__":
    sys.exit(run(Configured))
