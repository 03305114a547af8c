"""Tests of the detection of other packages named nep or nep-js on this computer."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from nep.programs.doctor.facts import PackageFact
from nep.programs.doctor.namesakes import node_packages, path_python_package

CLIENT = Path(__file__).resolve().parents[3] / "clients" / "javascript"


def node_package(folder: Path, described: str) -> str:
    package = folder / "node_modules" / "nep-js"
    package.mkdir(parents=True)
    (package / "package.json").write_text(described, "utf-8")
    return str(package)


def test_nep_js_packages_are_listed_in_search_order_of_node(tmp_path):
    ours = (CLIENT / "package.json").read_text("utf-8")
    project, shared = tmp_path / "project", tmp_path / "shared"
    near = node_package(project, json.dumps({"name": "nep-js", "version": "0.1.1"}))
    far = node_package(tmp_path, ours)
    last = node_package(shared, json.dumps({"name": "nep-js", "version": "0.1.0", "nep": "text"}))
    started = project / "src"
    started.mkdir()
    assert node_packages(started, {"NODE_PATH": str(shared / "node_modules")}) == (
        PackageFact("nep-js", "0.1.1", near, is_ours=False),
        PackageFact("nep-js", json.loads(ours)["version"], far),
        PackageFact("nep-js", "0.1.0", last, is_ours=False),
    )


@pytest.mark.parametrize("described", ["", "[]", "{", "[" * 100_000])
def test_unreadable_package_of_node_is_skipped(tmp_path, described):
    node_package(tmp_path, described)
    assert node_packages(tmp_path, {}) == ()


@pytest.fixture
def environment(tmp_path):
    """Folder of a Python environment with `python3` and site-packages."""
    made = tmp_path / "env"
    (made / "bin").mkdir(parents=True)
    python = made / "bin" / "python3"
    python.touch()
    python.chmod(0o755)
    (made / "lib" / "python3.11" / "site-packages").mkdir(parents=True)
    return made


def original(environment: Path, info: str, *, python: str = "python3.11") -> Path:
    site = environment / "lib" / python / "site-packages"
    (site / "nep").mkdir(parents=True)
    (site / info).mkdir()
    return site


def looked_up(environment: Path, own: Path = Path(sys.prefix)) -> PackageFact | None:
    return path_python_package(str(environment / "bin"), own, environment.parent / "home")


needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="programs have another suffix there")


@needs_posix
@pytest.mark.parametrize("info", ["nep-0.5.4.8.dist-info", "nep-0.5.4.8-py3.11.egg-info"])
def test_original_nep_in_the_python_of_the_terminal_is_found(environment, info):
    site = original(environment, info)
    assert looked_up(environment) == PackageFact("nep", "0.5.4.8", str(site), is_ours=False)
    assert looked_up(environment, own=environment) is None
    (site / "nep" / "protocol").mkdir()
    assert looked_up(environment) is None


@needs_posix
def test_user_packages_count_only_outside_virtual_environments(environment):
    site = original(environment.parent / "home" / ".local", "nep-0.5.4.8.dist-info")
    assert looked_up(environment) == PackageFact("nep", "0.5.4.8", str(site), is_ours=False)
    (environment / "pyvenv.cfg").touch()
    assert looked_up(environment) is None


@needs_posix
def test_packages_of_another_python_version_are_ignored(environment):
    python = environment / "bin" / "python3"
    python.rename(environment / "bin" / "python3.12")
    python.symlink_to("python3.12")
    original(environment.parent / "home" / ".local", "nep-0.5.4.8.dist-info")
    assert looked_up(environment) is None
