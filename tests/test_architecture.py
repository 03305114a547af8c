"""Tests of rules for the whole code base: layers, Qt only in app.ui, no sleep, plug-ins, requirements.

lint-imports (tools/check.py) checks the layers in the import graph. These tests read the sources, so
that a plain ``pytest`` also detects violations, including imports in functions and under TYPE_CHECKING.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from importlib import import_module
from importlib.metadata import distribution
from pathlib import Path
from typing import NamedTuple

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

from tests import syntax

pytestmark = pytest.mark.usefixtures("syntax_trees")
ROOT = Path(__file__).parents[1]
# From top to bottom: a module may import from its own line and the lines below.
LAYERS = (
    ("app.__main__",),
    ("app.ui", "app.run"),
    ("app.core",),
    ("app.blocks",),
    ("app.robots",),
    ("app.clock", "app.errors", "app.intents", "app.resources", "app"),
    ("nep",),
)
PLUG_INS = {"PANEL", "CATEGORY", "ROBOT", "BACKEND", "FIGURE"}
QT = {"PySide6", "shiboken6", "PyQt6", "PyQt5"}
NAMED_BY_ROS = {"nep.geometry", "nep.sensor"}
"""Modules whose classes have the names of ROS messages, such as `Header` and `Range`."""


class Import(NamedTuple):
    """Imported name and its line."""

    target: str
    line: int
    in_function: bool


class Module(NamedTuple):
    """Source file of the product."""

    name: str
    path: Path
    tree: ast.Module


@syntax.cached
def modules() -> tuple[Module, ...]:
    """Return every module of nep and app."""
    found = []
    for path in sorted([*ROOT.glob("nep/**/*.py"), *ROOT.glob("app/**/*.py")]):
        if "node_modules" in path.parts:
            continue
        parts = path.relative_to(ROOT).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        found.append(Module(name, path, syntax.parse(path)))
    return tuple(found)


@syntax.cached
def imports(tree: ast.Module) -> tuple[Import, ...]:
    """Return every import of a module with its dotted name; ``from a import b`` gives ``a.b``."""
    functions = [*syntax.nodes(tree, ast.FunctionDef), *syntax.nodes(tree, ast.AsyncFunctionDef)]
    lines = {line for each in functions for line in range(each.lineno, (each.end_lineno or 0) + 1)}
    plain = [
        Import(alias.name, node.lineno, node.lineno in lines)
        for node in syntax.nodes(tree, ast.Import)
        for alias in node.names
    ]
    return tuple(plain) + tuple(
        Import(f"{node.module}.{alias.name}", node.lineno, node.lineno in lines)
        for node in syntax.nodes(tree, ast.ImportFrom)
        for alias in node.names
    )


def layer(name: str) -> int | None:
    """Return the layer of a dotted name, 0 for the top layer; None for names of other packages."""
    for number, prefixes in enumerate(LAYERS):
        if any(name == prefix or name.startswith(f"{prefix}.") for prefix in prefixes):
            return number
    return None


def faults_of_layers(module: Module) -> list[str]:
    """Return the imports of a module from a higher layer."""
    own = layer(module.name)
    assert own is not None
    found = []
    for item in imports(module.tree):
        target = layer(item.target)
        if target is not None and target < own:
            found.append(f"{module.name}:{item.line} imports {item.target}")
    return found


def sleeps(tree: ast.Module) -> list[int]:
    """Return the lines that call ``x.sleep()``, ``sleep()``, ``msleep`` or ``usleep``."""
    names = {"sleep", "msleep", "usleep"}
    return [
        node.lineno
        for node in syntax.nodes(tree, ast.Call)
        if (isinstance(node.func, ast.Attribute) and node.func.attr in names)
        or (isinstance(node.func, ast.Name) and node.func.id in names)
    ]


def bound_plug_ins(tree: ast.Module) -> set[str]:
    """Return the plug-in names that a module binds."""
    targets = [
        target
        for node in tree.body
        if isinstance(node, ast.Assign | ast.AnnAssign)
        for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
    ]
    return {target.id for target in targets if isinstance(target, ast.Name)} & PLUG_INS


def environ_without_screen() -> dict[str, str]:
    return {**os.environ, "QT_QPA_PLATFORM": "offscreen"}


def test_all_packages_are_scanned() -> None:
    names = {module.name for module in modules()}
    assert {"nep", "app", "app.__main__", "app.ui", "app.core", "app.blocks", "app.robots"} <= names


def test_imports_follow_the_layers() -> None:
    assert [fault for module in modules() for fault in faults_of_layers(module)] == []


def test_upward_import_is_detected() -> None:
    tree = ast.parse("def f():\n    from app.ui import theme\n")
    assert faults_of_layers(Module("app.core.x", Path("x.py"), tree)) == ["app.core.x:2 imports app.ui.theme"]


def test_qt_is_imported_only_in_app_ui() -> None:
    faults = [
        f"{module.name}:{item.line} imports {item.target}"
        for module in modules()
        if not module.name.startswith("app.ui")
        for item in imports(module.tree)
        if item.target.split(".")[0] in QT
    ]
    assert faults == []


def test_imports_inside_functions_are_of_heavy_packages_only() -> None:
    # Entry points choose what to load: `python -m app run` must not load Qt, `nep --help` not all of nep.
    entries = {"app.__main__", "nep.__main__", "nep.cli"}
    # The view subclasses Qt WebEngine, which takes 0.2 s to load and is used only by the editor.
    # A plot subclasses pyqtgraph's view, which takes as long and is used only by open plot panels.
    # ROS nodes need XML-RPC, which takes 20 ms to load; other nodes don't.
    heavy_of_ours = {
        "app.ui.blockly.view",
        "app.ui.blockly.view.BlocklyView",
        "app.ui.panels.watch.plot.panel.PlotPanel",
        "nep.backends.ros.transport.RospyTransport",
    }
    only_on_some_systems = {"fcntl", "msvcrt", "resource", "winreg"}
    own_or_standard = {"nep", "app", *sys.stdlib_module_names} - only_on_some_systems
    faults = [
        f"{module.name}:{item.line} imports {item.target}"
        for module in modules()
        if module.name not in entries
        for item in imports(module.tree)
        if item.in_function
        and item.target.split(".")[0] in own_or_standard
        and item.target not in heavy_of_ours
    ]
    assert faults == []


def test_plug_ins_do_not_import_each_other() -> None:
    plug_ins = {module.name for module in modules() if bound_plug_ins(module.tree)}
    faults = [
        f"{module.name}:{item.line} imports {item.target}"
        for module in modules()
        if module.name in plug_ins
        for item in imports(module.tree)
        if item.target in plug_ins or item.target.rpartition(".")[0] in plug_ins
    ]
    assert faults == []


def classes_with_two_meanings(found: Iterable[Module]) -> dict[str, list[str]]:
    """Return the public class names that are defined more than once, with their places."""
    places: dict[str, list[str]] = {}
    for module in found:
        for node in syntax.nodes(module.tree, ast.ClassDef):
            if not node.name.startswith("_"):
                places.setdefault(node.name, []).append(f"{module.name}:{node.lineno}")
    return {name: where for name, where in places.items() if len(where) > 1}


def test_class_names_are_unique() -> None:
    ours = [module for module in modules() if module.name not in NAMED_BY_ROS]
    assert classes_with_two_meanings(ours) == {}


def test_duplicate_class_name_is_detected() -> None:
    one = Module("nep.one", Path("one.py"), ast.parse("class Alert: ...\nclass _Tile: ...\n"))
    two = Module("app.two", Path("two.py"), ast.parse("class _Tile:\n    class Alert: ...\n"))
    assert classes_with_two_meanings([one, two]) == {"Alert": ["nep.one:1", "app.two:2"]}


def test_no_code_calls_sleep() -> None:
    folders = ("nep", "app", "tools", "bench", "tests")
    paths = [ROOT / "dev.py", *(path for folder in folders for path in ROOT.glob(f"{folder}/**/*.py"))]
    faults = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in paths
        if "node_modules" not in path.parts
        if "sleep" in path.read_text(encoding="utf-8")
        for line in sleeps(syntax.parse(path))
    ]
    assert faults == []


@pytest.mark.parametrize(
    "source", ["time.sleep(1)", "sleep(1)", "QThread.msleep(5)", "await asyncio.sleep(0)"]
)
def test_sleep_call_is_detected(source: str) -> None:
    assert sleeps(ast.parse(f"async def f():\n    {source}\n")) == [2]


def processes_with_a_console(tree: ast.Module) -> list[int]:
    """Return the lines that start a process without ``creationflags``; Windows opens a console for it."""
    starts = {"Popen", "run", "call", "check_call", "check_output"}
    return [
        node.lineno
        for node in syntax.nodes(tree, ast.Call)
        if isinstance(node.func, ast.Attribute)
        and isinstance(node.func.value, ast.Name)
        and (node.func.value.id, node.func.attr) in {("subprocess", name) for name in starts}
        and "creationflags" not in {word.arg for word in node.keywords}
    ]


def test_no_process_opens_a_console_window_on_windows() -> None:
    assert processes_with_a_console(ast.parse("import subprocess\nsubprocess.run(['x'])")) == [2]
    assert [
        f"{module.name}:{line}" for module in modules() for line in processes_with_a_console(module.tree)
    ] == []


def places_that_replace_files(tree: ast.AST) -> list[int]:
    """Return the lines that replace or rename a file; ``replace`` with two arguments is a method of `str`."""
    return [
        node.lineno
        for node in syntax.nodes(tree, ast.Call)
        if isinstance(node.func, ast.Attribute)
        and node.func.attr in {"replace", "rename", "renames"}
        and (
            ast.unparse(node.func) in {"os.replace", "os.rename", "os.renames"}
            or (node.func.attr != "renames" and len(node.args) == 1 and not node.keywords)
        )
    ]


def test_files_are_replaced_only_by_the_helper_that_retries_on_windows() -> None:
    assert places_that_replace_files(ast.parse("path.replace(other)\n'a'.replace('a', 'b')\n")) == [1]
    found = {module.name for module in modules() if places_that_replace_files(module.tree)}
    assert found - {"nep.system.replace_file", "app.ui.blockly.view"} == set(), "the latter replaces a tab"


def test_qt_calls_do_not_change_the_reference_count_of_none() -> None:
    """PySide6 6.12.0 for Linux loses one reference per void call; Python 3.10 and 3.11 then abort."""
    program = (
        "import sys\n"
        "from PySide6.QtWidgets import QApplication, QLabel\n"
        "application = QApplication([])\n"
        "label = QLabel()\n"
        "before = sys.getrefcount(None)\n"
        "for number in range(1000):\n"
        "    label.setText('x')\n"
        "print(sys.getrefcount(None) - before)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=environ_without_screen(),
        capture_output=True,
        text=True,
        timeout=50,
        check=True,
    )
    assert abs(int(done.stdout)) < 100


def test_nep_loads_without_qt_numpy_and_opencv() -> None:
    heavy = sorted({*QT, "numpy", "cv2"})
    program = f"import sys, nep\nprint([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=50, check=True
    )
    assert done.stdout.strip() == "[]"


def requirements(extra: str = "") -> list[Requirement]:
    """Return the requirements of the installed distribution, with an extra or without."""
    found = [Requirement(text) for text in distribution("nep-studio").requires or []]
    return [item for item in found if item.marker is None or item.marker.evaluate({"extra": extra})]


def test_distribution_declares_its_requirements() -> None:
    metadata = distribution("nep-studio").metadata
    assert metadata["License-Expression"] == "MIT"
    assert metadata["Requires-Python"] == "<3.14,>=3.10"
    assert metadata["Summary"]
    plain = {normalised(item.name) for item in requirements()}
    assert {"pyzmq", "msgpack", "orjson"} <= plain
    assert plain.isdisjoint({"pyside6", "numpy", "opencv-python-headless"})
    studio = {normalised(item.name): item.specifier for item in requirements("studio")}
    assert "6.11.3" in studio["pyside6"]
    assert "6.12.0" not in studio["pyside6"]
    image = {normalised(item.name): item.specifier for item in requirements("image")}
    assert "5.0.0.93" not in image["opencv-python-headless"]


def test_entry_points_of_the_distribution_exist() -> None:
    commands = {item.name: item.value for item in distribution("nep-studio").entry_points}
    assert set(commands) == {"nep", "nep-studio"}
    for value in commands.values():
        module, name = value.split(":")
        assert callable(getattr(import_module(module), name))


def pinned() -> dict[str, list[Requirement]]:
    """Return the pinned requirements by normalised name; each has one version and the hashes of its files."""
    found: dict[str, list[Requirement]] = {}
    text = (ROOT / "requirements" / "dev.txt").read_text(encoding="utf-8")
    for line in text.replace("\\\n", " ").splitlines():
        requirement, *hashes = line.split("--hash=")
        item = Requirement(requirement)
        assert re.fullmatch(r"==[\w.]+", str(item.specifier)), line
        assert hashes
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", each.strip()) for each in hashes), line
        found.setdefault(normalised(item.name), []).append(item)
    return found


def test_studio_requirements_are_a_subset_of_the_dev_requirements() -> None:
    # Ignores environment markers, which may be wider in the extra dev.
    studio, dev = (
        set(re.sub(r" ;.*", "", (ROOT / "requirements" / f"{extra}.txt").read_text("utf-8")).split("\n"))
        for extra in ("studio", "dev")
    )
    assert studio <= dev


def normalised(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def test_all_installed_packages_are_pinned() -> None:
    pins = pinned()
    waiting = [item for extra in ("", "studio", "image", "test", "dev") for item in requirements(extra)]
    seen: set[str] = set()
    while waiting:
        item = waiting.pop()
        name = normalised(item.name)
        if name in seen or name == "nep-studio":
            continue
        seen.add(name)
        found = distribution(item.name)
        versions = [pin.specifier for pin in pins[name] if pin.marker is None or pin.marker.evaluate()]
        assert len(versions) == 1, f"{name} is pinned {len(versions)} times for this Python"
        assert Version(found.version) in versions[0], f"{name} {found.version} is not the pinned one"
        needs = [Requirement(text) for text in found.requires or []]
        waiting += [need for need in needs if need.marker is None or need.marker.evaluate({"extra": ""})]
    assert len(seen) > 20


def test_links_between_documents_resolve() -> None:
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    missing = [
        f"{page.relative_to(ROOT)}: {target}"
        for page in pages
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text(encoding="utf-8"))
        if target != "NNNN-title.md"
        and "://" not in target
        and not target.startswith("mailto:")
        and not (page.parent / target).exists()
    ]
    assert missing == []


def test_trust_page_lists_guaranteed_and_not_guaranteed_properties() -> None:
    page = (ROOT / "docs" / "trust.md").read_text(encoding="utf-8")
    for named in ("Programs of yours on this computer", "Other users of this computer", "after `--listen`"):
        assert named in page
    for part in ("What is made sure of", "What is not made sure of", "What pairing will change"):
        assert f"\n## {part}\n" in page
    assert "(docs/trust.md)" in (ROOT / "README.md").read_text(encoding="utf-8")
