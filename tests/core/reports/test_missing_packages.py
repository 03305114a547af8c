"""Tests of `nep-studio` without the extra ``studio``, as after a plain `pip install` of the wheel."""

from __future__ import annotations

import subprocess
import sys
from importlib import metadata
from pathlib import Path

from app.core.reports.not_installed import EXTRA_MODULES, import_problem

ROOT = Path(__file__).resolve().parents[3]
WITHOUT_THE_EXTRA = """
import importlib.machinery
import sys
from app.core.reports.not_installed import EXTRA_MODULES

class Absent:
    @staticmethod
    def find_spec(name, path=None, target=None):
        hidden = name.partition(".")[0] in EXTRA_MODULES
        return None if hidden else importlib.machinery.PathFinder.find_spec(name, path, target)

sys.meta_path[:] = [importlib.machinery.BuiltinImporter, importlib.machinery.FrozenImporter, Absent]
from app.__main__ import main
sys.exit(main(["--theme", "dark"]))
"""


def test_missing_extra_is_named_instead_of_a_traceback() -> None:
    child = subprocess.run(
        [sys.executable, "-c", WITHOUT_THE_EXTRA],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert child.returncode == 2
    assert "Traceback" not in child.stderr
    assert child.stderr.count("\n") == 1
    assert "pip install 'nep-studio[studio]'" in child.stderr


def test_all_missing_packages_are_named() -> None:
    error = ModuleNotFoundError("No module named 'platformdirs'", name="platformdirs")
    words = import_problem(error, lambda name: name != "PySide6")
    assert "(PySide6 and platformdirs)" in words


def test_import_errors_not_caused_by_missing_packages_are_not_explained() -> None:
    assert import_problem(ModuleNotFoundError("No module named 'app.odd'", name="app.odd")) == ""
    assert import_problem(ImportError("cannot import name 'x'", name="PySide6")) == ""


def test_checked_modules_belong_to_requirements_of_nep_studio() -> None:
    wanted = " ".join(metadata.requires("nep-studio") or ()).lower()
    packages = metadata.packages_distributions()
    assert all(any(each.lower() in wanted for each in packages[name]) for name in EXTRA_MODULES)
