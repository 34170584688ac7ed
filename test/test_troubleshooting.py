# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The page on troubleshooting quotes what programs really say."""

import re

import pytest
from pages import page

from scratch import ROOT

QUOTED = {
    "No executable ... is it built?": "tools/run",
    "This machine lacks ...": "tools/machine.py",
    "Wheels of ROS 2 exist for x86-64 Linux only": "tools/machine.py",
    "Waiting for another set-up or build of this workspace": "tools/steps.py",
}
"""Headings, and the sources of the programs that say so."""


@pytest.mark.parametrize("heading", QUOTED)
def test_headings_quote_the_messages_of_programs(heading):
    assert page("docs/troubleshooting.md").section(heading)
    pattern = ".*".join(re.escape(part.strip()) for part in heading.split("..."))
    assert re.search(pattern, (ROOT / QUOTED[heading]).read_text())


def test_packages_that_headings_name_exist():
    headings = re.findall(r"^## (.*)$", page("docs/troubleshooting.md").prose, re.MULTILINE)
    named = re.findall(r"No module named '(\w+)'", " ".join(headings))
    assert named
    assert all((ROOT / name / name / "__init__.py").exists() for name in named)
