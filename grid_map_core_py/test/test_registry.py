# SPDX-License-Identifier: BSD-3-Clause
"""Types of this package and of others, through entry points of distributions on the path."""

import itertools

import pytest

from grid_map_core_py.errors import ConfigError
from grid_map_core_py.plugins import Registry

GROUP = "grid_map_core_py.test_types"
NUMBERS = itertools.count()


class BuiltIn:
    pass


@pytest.fixture
def registry() -> Registry:
    return Registry({"built_in": BuiltIn, "other": object}, GROUP)


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Return a function that puts a distribution with one entry point on the path."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def install(type_name: str, code: str = "class Plugin: pass") -> str:
        package = f"registry_plugin_{next(NUMBERS)}"
        (tmp_path / f"{package}.py").write_text(code)
        information = tmp_path / f"{package}-1.0.dist-info"
        information.mkdir()
        (information / "METADATA").write_text(f"Name: {package}\nVersion: 1.0\n")
        entry = f"[{GROUP}]\n{type_name} = {package}:Plugin\n"
        (information / "entry_points.txt").write_text(entry)
        return f"{package}:Plugin"

    return install


@pytest.mark.parametrize(
    ("type_name", "hint"),
    [
        ("thier/Type", r"did you mean their/Type\? No installed package adds types of 'thier'"),
        (
            "my_package/New",
            "known: .*their/Type. No installed package adds types of 'my_package'; ",
        ),
        ("their/Typ", r"did you mean their/Type\?$"),
        ("built-in", r"unknown type 'built-in'; did you mean built_in\?$"),
        ("", r"unknown type ''; known: built_in, other, their/Type\.$"),
    ],
)
def test_error_of_unknown_type_suggests_types_and_packages(registry, install, type_name, hint):
    install("their/Type")
    with pytest.raises(ConfigError, match=hint):
        registry[type_name]


def test_other_packages_add_types(registry, install):
    install("their/Type", "class Plugin: answer = 42")
    assert registry["their/Type"].answer == 42
    assert registry.types == ("built_in", "other", "their/Type")


@pytest.mark.parametrize("type_name", ["built_in", "other"])
def test_built_in_type_cannot_be_registered_again(registry, install, type_name):
    where = install(type_name)
    with pytest.raises(ConfigError) as caught:
        registry["built_in"]
    assert str(caught.value) == (
        f"the type {type_name!r} is registered twice: as {where} and as a built-in"
    )


def test_two_packages_cannot_register_one_type(registry, install):
    install("sparkles")
    install("sparkles")
    with pytest.raises(ConfigError, match=r"'sparkles' is registered twice: as registry_plugin_.*"):
        registry["built_in"]


@pytest.mark.parametrize("code", ["import no_such_module", "1 / 0", "class Other: pass"])
def test_broken_plugin_affects_only_its_own_type(registry, install, code):
    where = install("broken", code)
    assert registry["built_in"] is BuiltIn
    with pytest.raises(ConfigError, match=f"cannot load '{where}': "):
        registry["broken"]
