"""Tests of modules that are imported on first use."""

from __future__ import annotations

import subprocess
import sys

import pytest

from nep.system.lazy_import import lazy_module


def in_a_new_process(program: str) -> str:
    """Run a program and return its output; modules that this process has imported must not count."""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=50, check=True
    )
    return done.stdout.strip()


def test_lazy_module_is_imported_on_first_attribute_access() -> None:
    program = (
        "import sys\n"
        "from nep.system.lazy_import import lazy_module\n"
        "colorsys = lazy_module('colorsys')\n"
        "print('colorsys' in sys.modules, colorsys.rgb_to_hsv(0, 0, 0), 'colorsys' in sys.modules)\n"
    )
    assert in_a_new_process(program) == "False (0.0, 0.0, 0) True"


def test_lazy_module_returns_attributes_of_the_module() -> None:
    assert lazy_module("colorsys").__getattr__("rgb_to_hls") is sys.modules["colorsys"].rgb_to_hls


def test_missing_lazy_module_or_attribute_raises_on_first_use() -> None:
    absent = lazy_module("nep.no_such_module")
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):
        absent.__getattr__("something")
    with pytest.raises(AttributeError, match="nothing_of_this_name"):
        lazy_module("colorsys").__getattr__("nothing_of_this_name")


def test_nep_import_does_not_load_rarely_used_modules() -> None:
    program = "import sys, nep\nprint([n for n in ('psutil', 'importlib.metadata') if n in sys.modules])"
    assert in_a_new_process(program) == "[]"
