# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The documentation is true: what it says to run works, links lead somewhere, tables are right.

How blocks are run:
    python  all of a page in one namespace; a `text output` block holds what the one before prints.
            With a `__main__` it is a program of its own, run until its node is there or, with
            `until="..."` behind the language, until it has printed that.
    bash    from the root of the workspace. A line with the comment `publishes /topic` runs until
            that topic has brought a message, and is then interrupted. Lines that begin with `ros2`
            are run where there is a `ros2`; their names are checked everywhere.
    yaml    a filter chain or the parameters of grid_map_visualization, which is built.
    text    is not run.
"""

import array
import ast
import dataclasses
import importlib
import importlib.util
import inspect
import json
import re
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from itertools import pairwise
from pathlib import Path

import pytest
import yaml
from pages import BLOCKS, PAGES, Block, Page, page, table
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

import grid_map_core_py
import grid_map_filters_py
import grid_map_ros_py
from grid_map_filters_py import FilterChain
from grid_map_filters_py.expression.functions import CONSTANTS, FUNCTIONS
from grid_map_filters_py.registry import BUILT_IN as FILTERS_BUILT_IN
from grid_map_ros_py.testing import Peer, Process, environment, peer, running, running_node
from grid_map_visualization_py.pictures import plot, plot_3d
from grid_map_visualization_py.registry import BUILT_IN, create
from scratch import ROOT, run

LANGUAGES = {"bash", "python", "text", "yaml"}
EXECUTED_TARGETS = {"demo"}
"""Targets of make that are run here; the others would not end, or take minutes."""

RUN_BLOCKS = """
import contextlib, io, json, pathlib, sys
name, file = sys.argv[1:]
outputs, namespace = [], {"__name__": "page"}
for line, code in json.loads(pathlib.Path(file).read_text()):
    with contextlib.redirect_stdout(io.StringIO()) as output:
        exec(compile("\\n" * line + code, name, "exec"), namespace)
    outputs.append(output.getvalue())
print(json.dumps(outputs))
"""

each_page = pytest.mark.parametrize("any_page", PAGES, ids=str)


def blocks(language: str, *, programs: bool = False) -> list[Block]:
    return [b for b in BLOCKS if b.language == language and b.is_program == programs]


# --- blocks ---------------------------------------------------------------------------------------


@each_page
def test_every_block_is_closed_and_of_a_known_language(any_page):
    assert any_page.text.count("```") == 2 * len(any_page.blocks)
    assert {block.language for block in any_page.blocks} <= LANGUAGES


def test_there_are_blocks_of_every_kind():
    assert {block.language for block in BLOCKS} == LANGUAGES
    assert blocks("python", programs=True)
    assert [block for block in BLOCKS if block.info == "output"]


PAGES_WITH_CODE = [p for p in PAGES if any(block.page == p for block in blocks("python"))]


@pytest.mark.parametrize("any_page", PAGES_WITH_CODE, ids=str)
def test_the_python_of_a_page_runs_and_prints_what_the_page_says(any_page, tmp_path):
    snippets = [b for b in any_page.blocks if b.language == "python" and not b.is_program]
    (tmp_path / "blocks.json").write_text(json.dumps([(b.line, b.text) for b in snippets]))
    command = (sys.executable, "-c", RUN_BLOCKS, str(any_page), "blocks.json")
    done = run(*command, environ=environment(), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    printed = dict(zip(map(str, snippets), json.loads(done.stdout), strict=True))
    assert printed == dict.fromkeys(printed, "") | announced_outputs(any_page)


def announced_outputs(any_page: Page) -> dict[str, str]:
    pairs = pairwise(any_page.blocks)
    return {str(code): output.text for code, output in pairs if output.info == "output"}


@pytest.mark.parametrize("block", blocks("python", programs=True), ids=str)
def test_a_python_program_works(block, tmp_path):
    path = tmp_path / "program.py"
    path.write_text(block.text)
    # One who waits for its output has also waited until the source was ready to be interrupted.
    source = source_of_maps() if block.until else nullcontext()
    with source, peer() as listener:
        known = {*listener.node.get_node_names()}
        # How a program ends is up to rclpy, unless it uses our `spin`, which has tests of its own.
        process = Process([sys.executable, str(path)])
        try:
            if block.until:
                listener.wait_until(lambda: block.until in process.text, block.until)
            else:
                listener.wait_until(lambda: {*listener.node.get_node_names()} - known, "its node")
        finally:
            process.kill()


@pytest.mark.parametrize("block", blocks("yaml"), ids=str)
def test_parameters_in_yaml_are_accepted(block, tmp_path):
    content = yaml.safe_load(block.text)
    (tmp_path / "parameters.yaml").write_text(block.text)
    if isinstance(content, list):
        assert len(FilterChain.from_config(content)) == len(content)
    elif "grid_map_visualization" in content:
        parameters = content["grid_map_visualization"]["ros__parameters"]
        for name in parameters["grid_map_visualizations"]:
            assert create(name, parameters[name]).message_type
    elif content.keys() <= NODES.keys():
        for name, parameters in content.items():
            assert parameters["ros__parameters"].keys() <= set(declared_parameters(name))
    else:
        assert len(FilterChain.from_yaml(tmp_path / "parameters.yaml")) > 0


# --- commands -------------------------------------------------------------------------------------


def commands(block: Block) -> list[tuple[str, str]]:
    """Return the lines of a bash block, each as command and comment."""
    lines = [line.partition("   # ") for line in block.text.splitlines() if line.strip()]
    return [(command.strip(), comment) for command, _, comment in lines]


def scripts() -> Iterator[tuple[str, str]]:
    """Yield every command of the documentation with the topic that ends it, or an empty one."""
    for block in blocks("bash"):
        before = ""
        for command, comment in commands(block):
            topic = re.search(r"publishes (/\S+)", comment)
            if topic:
                yield f"{before}exec {command}", topic[1]
            elif command.startswith(". "):
                before += f"{command} && "
            else:
                yield before + command, ""


def is_ros2(script: str) -> bool:
    return "ros2 " in script


SCRIPTS = dict(scripts())
ENDLESS = [
    (script, topic)
    for script, topic in SCRIPTS.items()
    if topic and (not is_ros2(script) or shutil.which("ros2"))
]
FINITE = {script for script, topic in SCRIPTS.items() if not topic}


@pytest.mark.parametrize(("script", "topic"), ENDLESS)
def test_a_command_publishes_until_it_is_interrupted(script, topic):
    # Two sources of maps would be taken for each other.
    source = nullcontext() if topic == "/grid_map" else source_of_maps()
    with source, peer() as listener, running(Process(["bash", "-c", f"cd {ROOT} && {script}"])):
        listener.listen(topic, message_type(listener, topic))
        listener.expect(topic)


@contextmanager
def source_of_maps() -> Iterator[Process]:
    command = ["tools/run", "grid_map_demos_py", "terrain_publisher"]
    with running(Process([str(ROOT / command[0]), *command[1:]])) as process:
        yield process


def message_type(listener: Peer, topic: str) -> type:
    """Wait until somebody offers a topic, and return its type."""
    offered: dict[str, list[str]] = {}

    def look() -> bool:
        offered.update(listener.node.get_topic_names_and_types())
        return topic in offered

    listener.wait_until(look, f"somebody who offers {topic}")
    package, _, name = offered[topic][0].split("/")
    found: type = getattr(importlib.import_module(f"{package}.msg"), name)
    return found


def test_commands_that_end_are_targets_of_make():
    assert {script.partition(" ")[0] for script in FINITE} == {"make"}
    assert {f"make {target}" for target in EXECUTED_TARGETS} <= FINITE


def test_make_demo_ends_well_and_leaves_its_pictures():
    pictures = [ROOT / "demo_output" / name for name in ("elevation.png", "traversability.png")]
    before = [path.stat().st_mtime if path.exists() else 0.0 for path in pictures]
    done = run("make", "demo", environ=environment())
    assert done.returncode == 0, done.stderr
    assert "/filtered_map" in done.stdout
    assert all(path.stat().st_mtime > old for path, old in zip(pictures, before, strict=True))


@each_page
def test_every_target_of_make_exists(any_page):
    named = set(re.findall(r"\bmake ([a-z][a-z-]*)", code(any_page)))
    known = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert named <= known


@each_page
def test_every_executable_exists(any_page):
    for package, name in re.findall(r"(?:ros2 run|tools/run) (grid_map_\w+) (\w+)", code(any_page)):
        assert f'"{name} = ' in (ROOT / package / "setup.py").read_text()
    for module in re.findall(r"python3? -m (grid_map_\S+)", code(any_page)):
        assert importlib.util.find_spec(module)


def code(any_page: Page) -> str:
    """Return all that a page sets as code, indented blocks too."""
    indented = re.findall(r"^ {4}.*$", any_page.prose, re.MULTILINE)
    return "\n".join([*any_page.inline_code, *indented, *(b.text for b in any_page.blocks)])


# --- links and names ------------------------------------------------------------------------------


@each_page
def test_links_lead_somewhere(any_page):
    for link in any_page.links:
        if link.startswith("https://"):
            continue
        name, _, anchor = link.partition("#")
        target = any_page.path.parent / name if name else any_page.path
        assert target.exists(), link
        assert not anchor or anchor in Page(target).anchors, link


FILES = [f"/{path.relative_to(ROOT)}" for path in ROOT.glob("*/**/*.*")]


@each_page
def test_files_that_are_named_exist(any_page):
    names = re.findall(
        r"[\w/]*/\w+\.(?:py|yaml|txt|lark|toml|sh|png)\b", " ".join(any_page.inline_code)
    )
    for name in names:
        written = name.startswith("demo_output/")
        assert written or any(file.endswith(f"/{name.lstrip('/')}") for file in FILES), name


def test_the_names_beside_those_of_cpp_exist():
    classes = grid_map_core_py.GridMap, grid_map_core_py.GridGeometry
    known = {name for one in (*classes, grid_map_core_py.SignedDistanceField) for name in dir(one)}
    for module in (grid_map_core_py, grid_map_filters_py, grid_map_ros_py):
        known |= {*module.__all__}
    cells = [row[1] for row in table(page("README.md").section("Names")) if row[0] != "C++"]
    assert len(cells) > 10
    for cell in cells:
        names = {one or other for one, other in re.findall(r"grid_map\.(\w+)|`(\w+)`", cell)}
        modules = re.findall(r"in `([\w.]+)`: ", cell)
        there = {name for module in modules for name in dir(importlib.import_module(module))}
        assert names <= (there or known), cell


def test_every_deviation_has_a_test():
    packages = ("grid_map_core_py", "grid_map_filters_py", "grid_map_ros_py")
    folders = [ROOT / package / "test" for package in packages]
    code = "".join(path.read_text() for folder in folders for path in folder.glob("*.py"))
    tests = set(re.findall(r"def (test_\w+)\(", code))
    rows = [row for row in table(page("docs/deviations.md").text) if row[0] != "golden data"]
    assert len(rows) > 50
    for row in rows:
        named = re.findall(r"(?:`|::)(test_\w+)`", row[-1])
        assert named, row
        assert set(named) <= tests, row


def test_every_error_is_in_the_tree():
    errors = [grid_map_core_py.GridMapError]
    for error in errors:
        ours = (e for e in error.__subclasses__() if e.__module__.endswith(".errors"))
        errors += [e for e in ours if e not in errors]
    assert len(errors) > 5
    tree = page("docs/architecture.md").section("Errors")
    assert [error.__name__ for error in errors if error.__name__ not in tree] == []


# --- pictures -------------------------------------------------------------------------------------


def page_of(type_name: str) -> Page:
    """Return the page of a filter, which is called like its module."""
    return page(f"docs/filters/{FILTERS_BUILT_IN[type_name].__module__.rpartition('.')[2]}.md")


def picture_of(type_name: str) -> str:
    """Return the name of the one picture on the page of a filter."""
    (name,) = re.findall(r"!\[[^\]]+\]\(\.\./images/filters/([\w.]+)\)", page_of(type_name).text)
    return name


def test_every_filter_has_a_page_and_every_page_a_filter():
    rows = table(page("docs/filters.md").section("The filters"))
    listed = dict(re.fullmatch(r"\[(.*)\]\((.*)\)", row[0]).groups() for row in rows)
    expected = {name: f"filters/{page_of(name).path.name}" for name in FILTERS_BUILT_IN}
    assert listed == expected
    pages = {f"filters/{path.name}" for path in (ROOT / "docs" / "filters").iterdir()}
    assert pages == {*expected.values()}
    for type_name in FILTERS_BUILT_IN:
        assert page_of(type_name).text.startswith(f"# {type_name}\n")


@pytest.mark.parametrize("type_name", FILTERS_BUILT_IN)
def test_the_page_of_filters_shows_what_every_filter_does(type_name):
    picture = ROOT / "docs" / "images" / "filters" / picture_of(type_name)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_pictures_of_filters_are_small_and_drawn_by_their_script(tmp_path):
    script = ROOT / "docs" / "images" / "make_filter_pictures.py"
    done = run(sys.executable, script, tmp_path / "new", environ=environment(), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    drawn = {path.name for path in (tmp_path / "new").iterdir()}
    stored = [*(ROOT / "docs" / "images" / "filters").iterdir()]
    assert drawn == {path.name for path in stored} == {*map(picture_of, FILTERS_BUILT_IN)}
    assert sum(path.stat().st_size for path in stored) < 2_000_000


# --- tables of parameters -------------------------------------------------------------------------


def fields(cls: type) -> dict[str, object]:
    """Return the parameters of a filter or visualization with their defaults; None without one."""
    return {
        field.name: None if field.default is dataclasses.MISSING else as_written(field.default)
        for field in dataclasses.fields(cls)
        if field.init
    }


def as_written(default: object) -> object:
    """Return a default as YAML has it, which knows no tuples."""
    return list(default) if isinstance(default, tuple) else default


def read_yaml(text: str) -> object:
    """Return a value as a page writes it; `inf` stands for YAML's `.inf`."""
    return yaml.safe_load(re.sub(r"^(-?)inf$", r"\1.inf", text.strip("` ")))


@pytest.mark.parametrize("type_name", FILTERS_BUILT_IN)
def test_the_page_of_filters_has_all_parameters_and_defaults(type_name):
    documented = {}
    for names, defaults, _ in table(page_of(type_name).text):
        values = [read_yaml(text) for text in defaults.split(",")]
        names = re.findall(r"`(\w+)`", names)
        documented |= dict(zip(names, values * (len(names) // len(values)), strict=True))
    assert documented == fields(FILTERS_BUILT_IN[type_name])


def test_the_page_of_ros_has_all_visualizations_parameters_and_defaults():
    documented = {}
    for type_name, _, parameters in table(page("docs/ros.md").section("Visualizations")):
        pairs = re.findall(r"`(\w+)`(?: \(([^)]*)\))?", parameters)
        documented[type_name.strip("`")] = {name: read_yaml(text) for name, text in pairs}
    assert documented == {name: fields(cls) for name, cls in BUILT_IN.items()}


NODES = {
    "filter_chain": "grid_map_filters_py/filter_chain_node.py",
    "grid_map_loader": "grid_map_ros_py/grid_map_loader_node.py",
    "grid_map_saver": "grid_map_ros_py/grid_map_saver_node.py",
    "grid_map_visualization": "grid_map_visualization_py/visualization_node.py",
    "octomap_to_grid_map": "grid_map_ros_py/octomap_to_grid_map_node.py",
    "point_cloud_to_grid_map": "grid_map_ros_py/point_cloud_to_grid_map_node.py",
    "web_viewer": "grid_map_visualization_py/web_viewer_node.py",
}
"""Modules of executables; each has a section with a table of its parameters in `docs/`."""


def declared_parameters(executable: str) -> list[str]:
    """Return the names of parameters that the docstring of a node lists."""
    module = Path(NODES[executable])
    source = (ROOT / module.parent / module).read_text()
    _, _, described = (ast.get_docstring(ast.parse(source)) or "").partition("Parameters:")
    return re.findall(r"^    (\w+): ", described, re.MULTILINE)


@pytest.mark.parametrize("executable", NODES)
def test_the_pages_have_all_parameters_of_a_node(executable):
    pages = [p for p in PAGES if str(p).startswith("docs/") and f"# {executable}\n" in p.text]
    (section,) = [each.section(executable) for each in pages]
    documented = [name for names, *_ in table(section) for name in re.findall(r"`(\w+)`", names)]
    assert sorted(documented) == sorted(declared_parameters(executable))


@pytest.mark.parametrize("executable", ["point_cloud_to_grid_map"])
def test_a_node_has_the_defaults_of_its_page(executable):
    (section,) = [each.section(executable) for each in PAGES if f"# {executable}\n" in each.text]
    documented = {name.strip("`"): read_yaml(default) for name, default, _ in table(section)}
    module = NODES[executable].removesuffix(".py").replace("/", ".")
    with running_node(module), peer() as listener:
        client = AsyncParameterClient(listener.node, executable)
        listener.wait_until(client.services_are_ready, "the services of its parameters")
        answer = client.get_parameters([*documented])
        listener.wait_until(answer.done, "its parameters")
    values = map(parameter_value_to_python, answer.result().values)
    found = [[*value] if isinstance(value, array.array) else value for value in values]
    # An empty text or list is written as nothing.
    assert [value or None for value in found] == [value or None for value in documented.values()]


def test_the_page_of_pictures_has_all_options_and_defaults():
    rows = list(table(page("docs/pictures.md").section("Python")))
    documented = {name for names, *_ in rows for name in re.findall(r"`(\w+)`", names)}
    defaults = {names.strip("` "): text.strip("` ").replace(" ", "") for names, text, _ in rows}
    options = {
        parameter.name: parameter.default
        for function in (plot, plot_3d)
        for parameter in inspect.signature(function).parameters.values()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY
    }
    assert documented == options.keys()
    for name in ("color_mode", "color_map", "invert", "exaggeration", "max_cells"):
        assert ast.literal_eval(defaults[name]) == options[name]


def test_the_page_of_expressions_has_all_functions():
    section = page("docs/expressions.md").section("Functions")
    documented = {word for row in table(section) for word in re.findall(r"\w+", row[0])}
    assert FUNCTIONS.keys() - documented == set()
    constants = page("docs/expressions.md").section("Names, numbers, matrices")
    assert [name for name in CONSTANTS if f"`{name}`" not in constants] == []
