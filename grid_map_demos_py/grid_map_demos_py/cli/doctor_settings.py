# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""How the environment is set for ROS and DDS."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from .output import byte_count

OUR_PACKAGES = (
    "grid_map_core_py",
    "grid_map_demos_py",
    "grid_map_filters_py",
    "grid_map_msgs",
    "grid_map_ros_py",
    "grid_map_visualization_py",
)

_LARGEST_DOMAIN, _LARGEST_SAFE_DOMAIN = 232, 101
_RANGES = ("OFF", "LOCALHOST", "SUBNET", "SYSTEM_DEFAULT")
_TRANSPORTS = (
    *("NONE", "DEFAULT", "DEFAULTv6", "SHM", "UDPv4", "UDPv6"),
    *("LARGE_DATA", "LARGE_DATAv6", "P2P"),
)
_SHARED_MEMORY = Path("/dev/shm")
_SEGMENT = 64 * 2**20
"""Bytes that the profile for large maps takes for every process."""


class Setting(NamedTuple):
    """A setting; `status` is "ok", "warning" or "broken"."""

    name: str
    value: str
    status: str = "ok"
    note: str = ""

    @property
    def text(self) -> str:
        """What people want to know about it."""
        return " - ".join(filter(None, (self.value, self.note)))

    def as_dict(self) -> dict[str, str]:
        """Return it as JSON has it."""
        return self._asdict()


def settings(*, with_ros: bool) -> list[Setting]:
    """Return the settings; those of ROS only where it is there."""
    checks: list[Callable[[], Setting]] = [_command]
    if with_ros:
        checks += [_distribution, _middleware, _domain, _range, _localhost_only, _peers]
        checks += [_profile, _transports, _shared_memory, _prefixes, _packages]
    return [check() for check in checks]


def _command() -> Setting:
    found = shutil.which("grid-map")
    if found:
        return Setting("grid-map", found)
    return Setting("grid-map", "", "warning", "is not on the PATH: source the workspace")


def _distribution() -> Setting:
    name = os.environ.get("ROS_DISTRO", "")
    if name in ("", "jazzy"):
        return Setting("ROS_DISTRO", name or "(not set)")
    return Setting("ROS_DISTRO", name, "warning", "the packages are made for jazzy")


def _middleware() -> Setting:
    name = os.environ.get("RMW_IMPLEMENTATION", "")
    if not name:
        return Setting("RMW_IMPLEMENTATION", "(not set: rmw_fastrtps_cpp)")
    if any((prefix / "lib" / f"lib{name}.so").exists() for prefix in _ament_prefixes()):
        return Setting("RMW_IMPLEMENTATION", name)
    return Setting("RMW_IMPLEMENTATION", name, "broken", "is not installed")


def _domain() -> Setting:
    text = os.environ.get("ROS_DOMAIN_ID", "")
    if not text:
        return Setting("ROS_DOMAIN_ID", "(not set: 0)")
    number = int(text) if text.isdecimal() else _LARGEST_DOMAIN + 1
    if number > _LARGEST_DOMAIN:
        expected = f"expected a number from 0 to {_LARGEST_DOMAIN}"
        return Setting("ROS_DOMAIN_ID", text, "broken", expected)
    if number > _LARGEST_SAFE_DOMAIN:
        note = f"from {_LARGEST_SAFE_DOMAIN + 1} on its ports may be in use by others"
        return Setting("ROS_DOMAIN_ID", text, "warning", note)
    return Setting("ROS_DOMAIN_ID", text)


def _range() -> Setting:
    name, text = "ROS_AUTOMATIC_DISCOVERY_RANGE", os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE")
    if not text:
        return Setting(name, "(not set: SUBNET)")
    if text not in _RANGES:
        return Setting(name, text, "warning", f"is none of {', '.join(_RANGES)}")
    if text == "OFF":
        return Setting(name, text, "warning", "no other process is found")
    return Setting(name, text)


def _localhost_only() -> Setting:
    text = os.environ.get("ROS_LOCALHOST_ONLY", "")
    if text == "1":
        note = "is outdated, and counts for more than ROS_AUTOMATIC_DISCOVERY_RANGE"
        return Setting("ROS_LOCALHOST_ONLY", text, "warning", note)
    return Setting("ROS_LOCALHOST_ONLY", text or "(not set)")


def _peers() -> Setting:
    return Setting("ROS_STATIC_PEERS", os.environ.get("ROS_STATIC_PEERS") or "(not set)")


def _profile() -> Setting:
    names = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
    name = next((one for one in names if os.environ.get(one)), names[0])
    path = os.environ.get(name, "")
    if not path:
        return Setting(name, "(not set)", note="large maps travel better with a profile")
    try:
        ElementTree.parse(path)
    except OSError as error:
        return Setting(name, path, "broken", f"cannot be read: {error.strerror}")
    except ElementTree.ParseError as error:
        return Setting(name, path, "broken", f"no valid XML: {error}")
    return Setting(name, path)


def _transports() -> Setting:
    name = "FASTDDS_BUILTIN_TRANSPORTS"
    text = os.environ.get(name, "")
    # Sizes may follow: LARGE_DATA?max_msg_size=1MB
    if text and text.partition("?")[0] not in _TRANSPORTS:
        return Setting(name, text, "warning", f"is none of {', '.join(_TRANSPORTS)}")
    return Setting(name, text or "(not set)")


def _shared_memory() -> Setting:
    name = str(_SHARED_MEMORY)
    try:
        usage = shutil.disk_usage(_SHARED_MEMORY)
    except OSError:
        return Setting(name, "", "warning", "is missing: processes talk over the network")
    segments = len([path for path in _SHARED_MEMORY.iterdir() if path.name.startswith("fastrtps_")])
    value = f"{byte_count(usage.free)} of {byte_count(usage.total)} free, {segments} files of DDS"
    if usage.free < _SEGMENT:
        note = "too little for the profile for large maps; 'fastdds shm clean' removes what is left"
        return Setting(name, value, "warning", note)
    return Setting(name, value)


def _prefixes() -> Setting:
    gone = [str(prefix) for prefix in _ament_prefixes() if not prefix.is_dir()]
    value = os.environ.get("AMENT_PREFIX_PATH", "") or "(not set)"
    if gone:
        return Setting("AMENT_PREFIX_PATH", value, "warning", f"not there: {', '.join(gone)}")
    return Setting("AMENT_PREFIX_PATH", value)


def _packages() -> Setting:
    """Tell which of our packages ROS can find: their executables, parameter and launch files."""
    index = Path("share", "ament_index", "resource_index", "packages")
    prefixes = _ament_prefixes()
    unknown = [
        name for name in OUR_PACKAGES if not any((one / index / name).exists() for one in prefixes)
    ]
    known = f"{len(OUR_PACKAGES) - len(unknown)} of {len(OUR_PACKAGES)}"
    if unknown:
        note = f"ROS does not find {', '.join(unknown)}: source the workspace"
        return Setting("packages in the index", known, "warning", note)
    return Setting("packages in the index", known)


def _ament_prefixes() -> list[Path]:
    return [Path(one) for one in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if one]
