"""Tests of the files that are stored next to a frozen program."""

from __future__ import annotations

import sys
from pathlib import Path

from installers.context import Context
from installers.freeze import add_licences


def test_each_package_of_a_release_has_its_own_bill_of_materials(tmp_path: Path) -> None:
    names = []
    for system, machine in (
        ("windows", "x86_64"),
        ("macos", "arm64"),
        ("macos", "x86_64"),
        ("linux", "x86_64"),
    ):
        does_nothing = (sys.executable, "-c", "")
        context = Context(system, does_nothing, root=tmp_path, version="1.2.3", machine=machine, epoch=0)
        context.work.mkdir(parents=True, exist_ok=True)
        names.append(add_licences(context, tmp_path, tmp_path).name)
    assert names == [
        f"NEP-Studio-1.2.3-{of}.cdx.json" for of in ("windows", "macos-arm64", "macos-x86_64", "linux")
    ]
