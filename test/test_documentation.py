# SPDX-License-Identifier: BSD-3-Clause
"""Commands and snippets of the documentation work, links resolve, tables equal the code.

How blocks are run:
    python  all of a page in one namespace and one scratch folder; a `text output` block holds what
            the one before prints. With a `__main__` it is a program of its own, run until its node
            is there or, with `until="..."` behind the language, until it has printed that.
    bash    with a `text output` block behind it, or with `finite` behind the language, in the same
            folder and order as the Python of the page; it must end well. So is one with the comment
            `prints TEXT`, which is interrupted when it has printed that.
            Other lines from the root of the workspace: one with the comment `publishes /topic` runs
            until that topic has brought a message, and is then interrupted. Those that begin with
            `ros2` are run where there is a `ros2`; their names are checked everywhere.
            The block marked `ros` runs with stand-ins for the network; `pip` names packages; `venv`
            builds the core.
    yaml    a filter chain or the parameters of a node of ours, which are built or looked up.
    text, xml, cpp are not run.

The blocks of the tutorial are followed by test_tutorial.py.
"""

import ast
import importlib
import importlib.util
import inspect
import os
import re
import shutil
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path
from pkgutil import resolve_name

import pytest
import rclpy
import yaml
from pages import BLOCKS, PAGES, Block, Page, page, table
from rclpy.parameter_client import AsyncParameterClient

import grid_map_core_py
import grid_map_filters_py
import grid_map_ros_py
from grid_map_core_py._packages import PACKAGES as PACKAGES_OF_DOCTOR
from grid_map_core_py._parameters import DEEPEST
from grid_map_core_py.errors import cut
from grid_map_core_py.files._formats import (
    formats,
    options_of,
)
from grid_map_demos_py.terrain import load_terrain
from grid_map_filters_py import FilterChain
from grid_map_filters_py._registry import BUILT_IN as FILTERS_BUILT_IN
from grid_map_filters_py.expression import _interpreter
from grid_map_filters_py.expression._functions import CONSTANTS, FUNCTIONS
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import to_message
from grid_map_ros_py._elevation_mapping.sources import MODELS
from grid_map_ros_py.nodes import (
    map_qos,
)
from grid_map_ros_py.nodes._health import LogThrottle
from grid_map_ros_py.testing import (
    Peer,
    Process,
    environment,
    peer,
    reserve_domain,
    running,
    running_node,
    wait_until,
)
from grid_map_visualization_py._registry import BUILT_IN, create
from grid_map_visualization_py._rerun.server import SETTINGS
from grid_map_visualization_py.pictures import plot, plot_3d, plot_relief
from scratch import PACKAGES, PYTHON_PACKAGES, ROOT, executables, fresh_environment, run

LANGUAGES = {"bash", "cpp", "python", "text", "xml", "yaml"}
INDEX = page("docs/index.md")
TUTORIAL = page("docs/tutorial.md")
TERRAIN = ROOT / "grid_map_demos_py" / "data" / "jacksboro_fault_dem.npz"
EXECUTED_TARGETS = {"demo"}
"""Targets of make that are run here; the others would not end, or take minutes."""

each_page = pytest.mark.parametrize("any_page", PAGES, ids=str)


def blocks(language: str, *, programs: bool = False) -> list[Block]:
    ours = (block for block in BLOCKS if block.page != TUTORIAL)
    return [b for b in ours if b.language == language and b.is_program == programs]


# --- blocks ---------------------------------------------------------------------------------------


@each_page
def test_every_block_is_closed_and_of_a_known_language(any_page):
    assert any_page.text.count("```") == 2 * len(any_page.blocks)
    known = LANGUAGES | {"{toctree}"} if any_page == INDEX else LANGUAGES
    assert {block.language for block in any_page.blocks} <= known


def test_there_are_blocks_of_every_kind():
    assert {block.language for block in BLOCKS} >= {"bash", "python", "text", "yaml"}
    assert blocks("python", programs=True)
    assert [block for block in BLOCKS if block.info == "output"]


def announced_outputs(any_page: Page) -> dict[str, str]:
    """Return the outputs of a page by the blocks before them."""
    pairs = pairwise(any_page.blocks)
    return {str(code): output.text for code, output in pairs if output.info == "output"}


OUTPUTS = {name: text for each in PAGES for name, text in announced_outputs(each).items()}


def is_finite(block: Block) -> bool:
    return block.info == "finite" or bool(block.until) or str(block) in OUTPUTS


FINITE_COMMANDS = [block for block in blocks("bash") if is_finite(block)]
PAGES_THAT_RUN = dict.fromkeys(block.page for block in blocks("python") + FINITE_COMMANDS)


START = """
import os, subprocess
def run_bash(text, until):
    if not until:
        path = f"{os.environ['WARM']}:{os.environ['PATH']}"
        subprocess.run(["bash", "-ec", text], check=True, env={**os.environ, "PATH": path})
        return
    from grid_map_ros_py.testing import Process, running, wait_until
    with running(Process(["bash", "-ec", f"exec {text}"])) as process:
        wait_until(lambda: until in process.text, until)
"""


def program(steps: list[Block]) -> str:
    """Return a Python program that runs blocks in order and prints a null character after each."""
    texts = [
        f"run_bash({block.text!r}, {block.until!r})\n" if block.language == "bash" else block.text
        for block in steps
    ]
    return START + "".join(f"{text}print(end='\\0', flush=True)\n" for text in texts)


@pytest.fixture(scope="module")
def warm(tmp_path_factory) -> Iterator[Path]:
    """A folder with a `grid-map` that starts quickly; other tests start the installed one."""
    folder = tmp_path_factory.mktemp("warm")
    process = Process([sys.executable, "-P", str(Path(__file__).with_name("warm.py")), str(folder)])
    try:
        wait_until(lambda: process.lines, "the command")
        yield folder
        assert process.lines == ["serves\n"]
    finally:
        process.stop()


@pytest.mark.parametrize("any_page", PAGES_THAT_RUN, ids=str)
def test_page_runs_and_prints_its_announced_output(any_page, tmp_path, warm):
    that_run = blocks("python") + FINITE_COMMANDS
    steps = [block for block in any_page.blocks if block in that_run]
    (tmp_path / "page.py").write_text(program(steps))
    # Rerun greets users whose settings it does not find.
    settings = shutil.copytree(SETTINGS, tmp_path / "settings")
    environ = environment() | {"WARM": str(warm), "XDG_CONFIG_HOME": str(settings)}
    done = run(sys.executable, "page.py", environ=environ, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    *outputs, _ = done.stdout.split("\0")
    printed = dict(zip(map(str, steps), outputs, strict=True))
    assert printed == dict.fromkeys(printed, "") | announced_outputs(any_page)


@pytest.mark.parametrize("block", blocks("python", programs=True), ids=str)
def test_a_python_program_works(block, tmp_path):
    path = tmp_path / "program.py"
    path.write_text(block.text)
    with peer() as listener:
        known = {*listener.node.get_node_names()}
        if block.until:
            publish_maps(listener)
        # rclpy decides how a program ends, unless it uses our `spin`, which has its own tests.
        process = Process([sys.executable, str(path)])
        try:
            if block.until:
                listener.wait_until(lambda: block.until in process.text, block.until)
            else:
                listener.wait_until(lambda: {*listener.node.get_node_names()} - known, "its node")
        finally:
            process.stop()


@pytest.mark.parametrize("block", blocks("yaml"), ids=str)
def test_parameters_in_yaml_are_accepted(block, tmp_path):
    path = tmp_path / "parameters.yaml"
    path.write_text(block.text)
    content = yaml.safe_load(block.text)
    if "ros__parameters" in block.text:
        # The parser of ROS accepts the file.
        context = rclpy.Context()
        rclpy.init(args=["--ros-args", "--params-file", str(path)], context=context)
        context.shutdown()
    if "grid_map_visualization" in content:
        parameters = content["grid_map_visualization"]["ros__parameters"]
        for name in parameters["grid_map_visualizations"]:
            assert create(name, parameters[name]).message_type
    elif isinstance(content, dict) and content.keys() <= NODES:
        for name, parameters in content.items():
            # Those below a name, such as `input_sources.NAME.topic`, count by its first part.
            known = {word.partition(".")[0] for word in documented_parameters(name)}
            assert parameters["ros__parameters"].keys() <= known
    else:
        assert len(FilterChain.from_yaml(path)) > 0


RAISE = """
import sys
from grid_map_core_py import GridMap
from grid_map_filters_py import FilterChain
chain = FilterChain.from_yaml(sys.argv[1])
print(chain(GridMap((1.0, 1.0), 0.5, layers={"elevation": 2.0}))["elevation"].max())
"""


def test_yaml_names_the_filter_of_the_package_on_the_page(tmp_path):
    for block in page("docs/filters.md").blocks:
        if block.file:
            (tmp_path / block.file).write_text(block.text)
    assert len([*tmp_path.iterdir()]) == 3
    # As colcon installs it, without a network.
    target = tmp_path / "installed"
    options = f"--install-lib={target}", "--single-version-externally-managed", "--record=files"
    command = (sys.executable, "setup.py", "--quiet", "install", *options)
    done = run(*command, environ=os.environ, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (tmp_path / "offset_filter.py").unlink()
    environ = {**os.environ, "PYTHONPATH": f"{target}:{os.environ['PYTHONPATH']}"}
    done = run(sys.executable, "-c", RAISE, tmp_path / "chain.yaml", environ=environ, cwd=tmp_path)
    assert (done.stdout, done.stderr) == ("3.5\n", "")


# --- commands -------------------------------------------------------------------------------------


def commands(block: Block) -> list[tuple[str, str]]:
    """Return the lines of a bash block, each as command and comment."""
    lines = [line.partition("   # ") for line in block.text.splitlines() if line.strip()]
    return [(command.strip(), comment) for command, _, comment in lines]


def scripts() -> Iterator[tuple[str, str]]:
    """Yield every command of the documentation with the topic that ends it, or an empty one."""
    for block in blocks("bash"):
        if is_finite(block) or block.info in {"ros", "pip", "venv"}:
            continue
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


# Four at a time, because they mostly start or wait.
@pytest.mark.parametrize("group", [ENDLESS[k : k + 4] for k in range(0, len(ENDLESS), 4)])
def test_commands_publish_until_they_are_interrupted(group):
    with ExitStack() as stack:
        for script, topic in group:
            stack.enter_context(delivers(script, topic))


@contextmanager
def delivers(script: str, topic: str) -> Iterator[None]:
    """Start a command in its own ROS domain; at the end its topic must deliver a message."""
    domain, lock = reserve_domain()
    command = ["bash", "-c", f"cd {ROOT} && {script}"]
    process = Process(command, environment(domain))
    with lock, peer(domain) as listener, running(process):
        # Maps of two sources at once would be mixed up.
        if topic != "/grid_map":
            publish_maps(listener)
        yield
        try:
            listener.wait_until(lambda: topic in offered(listener), f"a publisher of {topic}")
            listener.listen(topic, resolve_name(offered(listener)[topic][0].replace("/", ".")))
            listener.expect(topic)
        finally:
            print(f"$ {script}\n{process.text}")


def offered(listener: Peer) -> dict[str, list[str]]:
    """Return the names of the types of all topics."""
    return dict(listener.node.get_topic_names_and_types())


def publish_maps(listener: Peer) -> None:
    """Publish a terrain now, and twice a second while the listener waits."""
    publisher = listener.node.create_publisher(GridMapMessage, "/grid_map", map_qos())
    message = to_message(load_terrain(TERRAIN))
    publisher.publish(message)
    listener.node.create_timer(0.5, lambda: publisher.publish(message))


def test_finite_commands_are_make_targets_or_launch_files():
    assert {script.partition(" ")[0] for script in FINITE if not is_ros2(script)} == {"make"}
    assert all("ros2 launch " in script for script in FINITE if is_ros2(script))
    assert {f"make {target}" for target in EXECUTED_TARGETS} <= FINITE


STAND_INS = f"""
source() {{ [ "$1" = /opt/ros/jazzy/setup.bash ]; }}
git() {{ [ "$1 $2" = "clone https://github.com/grid-map-py/grid_map_py" ] && ln -s {ROOT} "$3"; }}
rosdep() {{ [ "$*" = "install --from-paths $(echo src/grid_map_py/*_py) --ignore-src -y" ]; }}
colcon() {{ [ "$*" = build ] && command colcon list --names-only; }}
"""
"""They replace ROS and the network; colcon only lists the packages that it would build."""


def install_command(info: str) -> str:
    (block,) = (block for block in BLOCKS if block.info == info)
    return block.text


def test_ros_workspace_of_readme_has_all_packages(tmp_path):
    script = STAND_INS + install_command("ros")
    done = run("bash", "-ec", script, environ=environment() | {"HOME": str(tmp_path)})
    assert done.returncode == 0, done.stderr
    assert sorted(done.stdout.split()) == sorted(path.name for path in PACKAGES)


def test_executables_start_the_python_that_built_them(tmp_path):
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "grid_map_core_py").symlink_to(ROOT / "grid_map_core_py")
    libraries = sysconfig.get_path("purelib")  # instead of those of apt
    environ = fresh_environment(PYTHONPATH=libraries)
    done = run("bash", "-ec", install_command("venv"), environ=environ, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    program = tmp_path / "install/grid_map_core_py/lib/grid_map_core_py/grid_map"
    assert f"{tmp_path}/venv/bin/python" in program.read_text().partition("\n")[0]


def test_pip_command_of_readme_names_packages():
    """The tests of packages install them into a virtual environment."""
    program, *paths = install_command("pip").removeprefix("pip ").split()
    assert program == "install"
    assert {*paths} <= {f"./{path.name}" for path in PYTHON_PACKAGES}


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
        assert name in executables(package)
    for package, name in re.findall(r"ros2 launch (grid_map_\w+) (\S+)", code(any_page)):
        assert (ROOT / package / "launch" / name).exists()
    for module in re.findall(r"python3? -m (grid_map_\S+)", code(any_page)):
        assert importlib.util.find_spec(module)


def code(any_page: Page) -> str:
    """Return all code of a page, indented blocks included."""
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
    files = FILES + [f"/{block.file}" for block in any_page.blocks if block.file]
    for name in names:
        # Paths in `~/.ros` are defaults of parameters.
        written = name.startswith(("demo_output/", "ros/"))
        assert written or any(file.endswith(f"/{name.lstrip('/')}") for file in files), name


def test_table_of_formats_has_all_formats_and_options():
    known, listed = formats(), []
    for row in table(page("docs/files.md").text.partition("\n## ")[0]):
        names, *_, loading, saving, needed = (re.findall(r"`(\w+)`", cell) for cell in row)
        for one in (known[name] for name in names):
            assert {"layers", *loading} == {"layers", *options_of(one.load)}
            assert {*saving} == {*options_of(one.save, 2)}
            assert {*needed} <= PACKAGES_OF_DOCTOR.keys()
            listed.append(one.name)
    assert sorted(listed) == sorted(known)


def test_table_of_installation_is_that_of_doctor():
    rows = table(page("docs/installation.md").section("What each feature needs"))
    found = [tuple(cell.strip("`").replace("$ROS_DISTRO", "*") for cell in row) for row in rows]
    listed = {name: one for name, one in PACKAGES_OF_DOCTOR.items() if one.apt or one.pip}
    assert found == [(one.gives, name, one.apt, one.pip) for name, one in listed.items()]


def test_names_beside_cpp_names_exist():
    classes = grid_map_core_py.GridMap, grid_map_core_py.GridGeometry
    known = {name for one in (*classes, grid_map_core_py.SignedDistanceField) for name in dir(one)}
    for module in (grid_map_core_py, grid_map_filters_py, grid_map_ros_py):
        known |= {*module.__all__}
    cells = [row[1] for row in table(page("docs/migration_cpp.md").section("Names"))]
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
    rows = [*table(page("docs/deviations.md").text)]
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


# --- pages ----------------------------------------------------------------------------------------


NODES = {
    name
    for package in ("grid_map_filters_py", "grid_map_ros_py", "grid_map_visualization_py")
    for name, module in executables(package).items()
    if "._executables." in module
} - {"snapshot"}
"""Executables that are nodes with parameters; the others have options."""


def names_of_pages(folder: str) -> set[str]:
    return {path.stem for path in (ROOT / "docs" / folder).glob("*.md")} - {"README"}


def links_of_table(section: str) -> dict[str, str]:
    """Return the links in the first column of a table, by their texts."""
    cells = (re.fullmatch(r"\[(.*)\]\((.*)\)", row[0]) for row in table(section))
    return dict(found.groups() for found in cells if found)


def page_of(type_name: str) -> Page:
    """Return the page of a filter; it is named like the filter's module."""
    module = FILTERS_BUILT_IN[type_name].__module__.rpartition(".")[2]
    return page(f"docs/filters/{module.removeprefix('_')}.md")


PAGES_OF_PARAMETERS = {
    **{name: page_of(name) for name in FILTERS_BUILT_IN},
    **{name: page(f"docs/visualizations/{name}.md") for name in BUILT_IN},
    **{name: page(f"docs/nodes/{name}.md") for name in sorted(NODES)},
}


def entries_of_navigation() -> Iterator[str]:
    """Yield the pages that the site's navigation names, as patterns without suffix."""
    for block in INDEX.blocks:
        yield from (f"docs/{line}" for line in block.text.splitlines() if line and line[0] != ":")
    configuration = (ROOT / "docs" / "conf.py").read_text()
    (overviews,) = re.findall(r"^OVERVIEWS = (\{.*?^\})", configuration, re.MULTILINE | re.DOTALL)
    for overview, pattern in ast.literal_eval(overviews).items():
        yield f"{Path(overview).parent}/{pattern}"


def test_every_page_is_in_the_navigation():
    patterns = [f"{entry}.md" for entry in entries_of_navigation()]
    listed = {path.resolve() for pattern in patterns for path in ROOT.glob(pattern)}
    missing = [str(each) for each in PAGES if each.path not in listed and each != INDEX]
    assert missing == []


TABLES = {
    "filters": ("docs/filters.md", "The filters"),
    "visualizations": ("docs/ros.md", "Visualizations"),
    "nodes": ("docs/ros.md", "Nodes"),
}
"""Folders of pages of parameters, and the page and section of the table that links them."""


@pytest.mark.parametrize("folder", TABLES)
def test_table_links_all_pages_of_a_folder(folder):
    overview, section = TABLES[folder]
    pages = {name: each.path for name, each in PAGES_OF_PARAMETERS.items()}
    expected = {name: path.stem for name, path in pages.items() if path.parent.name == folder}
    links = links_of_table(page(overview).section(section))
    assert links == {name: f"{folder}/{stem}.md" for name, stem in expected.items()}
    assert names_of_pages(folder) == {*expected.values()}


def test_table_of_visualizations_names_their_messages():
    for type_name, message, _ in table(page("docs/ros.md").section("Visualizations")):
        (name,) = re.findall(r"\[(\w+)\]", type_name)
        message_type = BUILT_IN[name].message_type
        package = message_type.__module__.partition(".")[0]
        assert message == f"`{package}/{message_type.__name__}`"


def test_every_conversion_has_a_page_that_the_overview_links():
    overview = page("docs/converters.md")
    pages = {f"conversions/{name}.md": name for name in names_of_pages("conversions")}
    assert {link for link in overview.links if link.startswith("conversions/")} == pages.keys()
    described = {name for link in pages for name in words(page(f"docs/{link}"))}
    listed = words(overview)
    conversions = [
        name
        for name in grid_map_ros_py.__all__
        if re.match(r"(to|from|add)_|read_points|octomap_to_points", name)
    ]
    assert len(conversions) > 20
    assert [name for name in conversions if name not in described] == []
    polygons = words(page("docs/conversions/polygon.md"))
    assert [name for name in conversions if name not in listed | polygons] == []


def words(any_page: Page) -> set[str]:
    return set(re.findall(r"\w+", " ".join(any_page.inline_code)))


def test_every_demo_has_a_page_that_the_overview_links():
    names = executables("grid_map_demos_py").keys()
    overview = page("docs/demos/README.md")
    assert [name for name in names - {"grid_map"} if f"`{name}`" not in overview.text] == []
    demos = {name for name in names if name.endswith("_demo")} | {"iterator_benchmark"}
    assert sorted(demos - names_of_pages("demos")) == []
    for name in names_of_pages("demos"):
        assert f"{name}.md" in overview.links


# --- troubleshooting ----------------------------------------------------------------------------


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


# --- tables of parameters -------------------------------------------------------------------------


def test_tables_of_parameters_equal_the_code():
    script = ROOT / "tools" / "parameter_tables.py"
    done = run(sys.executable, script, "--check", environ=environment())
    assert done.returncode == 0, done.stdout + done.stderr


def test_outdated_table_is_named_and_rewritten(tmp_path):
    (right,) = re.findall(
        r"<!-- parameters: .*<!-- end -->", page("docs/visualizations/vectors.md").text, re.DOTALL
    )
    (tmp_path / "page.md").write_text(f"before\n\n{right.replace('0.003', '0.004')}\n\nafter\n")
    command = (sys.executable, ROOT / "tools" / "parameter_tables.py", tmp_path / "page.md")
    checked = run(*command, "--check", environ=environment())
    assert (checked.returncode, "page.md is outdated" in checked.stdout) == (1, True)
    assert "0.004" in (tmp_path / "page.md").read_text()
    assert run(*command, environ=environment()).returncode == 0
    assert (tmp_path / "page.md").read_text() == f"before\n\n{right}\n\nafter\n"


@pytest.mark.parametrize("name", PAGES_OF_PARAMETERS)
def test_page_of_parameters_has_their_title_and_table(name):
    text = PAGES_OF_PARAMETERS[name].text
    assert text.startswith(f"# {name}\n")
    tables = re.findall(r"<!-- parameters: (\S+) -->\n.*?<!-- end -->", text, re.DOTALL)
    assert tables == [name, *(MODELS if name == "elevation_mapping" else ())]


def documented_parameters(executable: str) -> dict[str, list[str]]:
    """Return type, default and meaning of the parameters on the page of a node."""
    _, _, rest = PAGES_OF_PARAMETERS[executable].text.partition("<!-- parameters: ")
    rows = table(rest.partition("<!-- end -->")[0])
    return {name.strip("`"): cells for name, *cells in rows}


def test_running_node_describes_its_parameters_as_its_page():
    documented = documented_parameters("point_cloud_to_grid_map")
    assert len(documented) > 20
    with running_node("grid_map_ros_py._executables.point_cloud_to_grid_map"), peer() as listener:
        client = AsyncParameterClient(listener.node, "point_cloud_to_grid_map")
        listener.wait_until(client.services_are_ready, "the services of its parameters")
        answer = client.describe_parameters([*documented])
        listener.wait_until(answer.done, "its parameters")
    found = [descriptor.description for descriptor in answer.result().descriptors]
    assert found == [meaning for *_, meaning in documented.values()]


def test_the_page_of_pictures_has_all_options_and_defaults():
    rows = list(table(page("docs/pictures.md").section("Python")))
    documented = {name for names, *_ in rows for name in re.findall(r"`(\w+)`", names)}
    defaults = {names.strip("` "): text.strip("` ").replace(" ", "") for names, text, _ in rows}
    options = {
        parameter.name: parameter.default
        for function in (plot, plot_3d, plot_relief)
        for parameter in inspect.signature(function).parameters.values()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY
    }
    assert documented == options.keys()
    for name in ("color_mode", "color_map", "invert", "exaggeration", "max_drawn_cells"):
        assert ast.literal_eval(defaults[name]) == options[name]


def test_the_page_of_security_has_the_limits_of_the_code():
    throttle = inspect.signature(LogThrottle).parameters
    limits = [
        DEEPEST,
        _interpreter._DEEPEST,
        len(cut("x" * 10**6)),
        f"{throttle['period'].default:g} s",
    ]
    rows = table(page("docs/security.md").section("Limits"))
    assert [value for _, value in rows] == [*map(str, limits)]


def test_the_page_of_expressions_has_all_functions():
    section = page("docs/expressions.md").section("Functions")
    documented = {word for row in table(section) for word in re.findall(r"\w+", row[0])}
    assert FUNCTIONS.keys() - documented == set()
    constants = page("docs/expressions.md").section("Names, numbers, matrices")
    assert [name for name in CONSTANTS if f"`{name}`" not in constants] == []
