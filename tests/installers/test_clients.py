"""Tests of the client libraries' packages: nep-js installs from its file; missing tools skip a package."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from installers.clients.packer import check_nuget, pack_built_javascript, pack_javascript, pack_nuget
from installers.context import PackageError
from tests.clients.node_programs import NEEDS_NODE, PACKAGE, build_package, node, npm, run_npm

PROGRAMS = {
    "require.cjs": 'const nep = require("nep-js"); console.log(typeof nep.Node, nep.Node === nep.node);',
    "import.mjs": 'import nep, { Node } from "nep-js"; console.log(typeof Node, Node === nep.Node);',
}


def needs_node(test: Callable[[Path], None]) -> Callable[[Path], None]:
    for mark in NEEDS_NODE:
        test = mark(test)
    return test


@needs_node
def test_installed_javascript_package_can_be_required_and_imported(tmp_path: Path) -> None:
    build_package()
    packed = pack_built_javascript(str(npm), PACKAGE, tmp_path)
    install = ("install", "--prefer-offline", "--ignore-scripts", "--no-audit", "--no-fund", "--silent")
    run_npm(*install, str(packed), folder=tmp_path)
    for name, program in PROGRAMS.items():
        (tmp_path / name).write_text(program, "utf-8")
        done = subprocess.run(
            [str(node), name], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
        )
        assert (done.stdout, done.stderr) == ("function true\n", "")


@pytest.mark.parametrize("pack", [pack_javascript, pack_nuget])
def test_package_is_skipped_without_its_tool(
    pack: Callable[[Path, Path], list[Path]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert pack(tmp_path, tmp_path) == []
    assert len(capsys.readouterr().out.splitlines()) == 1


NUSPEC = """<?xml version="1.0" encoding="utf-8"?>
<package xmlns="http://schemas.microsoft.com/packaging/2013/05/nuspec.xsd"><metadata>
<id>Nep</id><version>0.1.0</version><authors>The NEP Studio authors</authors>
<license type="expression">MIT</license><readme>README.md</readme><description>Messages</description>
<dependencies><group targetFramework=".NETStandard2.0"><dependency id="Newtonsoft.Json" version="13.0.3" />
</group></dependencies></metadata></package>
"""


def write_nuget(path: Path, nuspec: str = NUSPEC, *, leaves_out: str = "") -> None:
    """Write a NuGet package with the files that `dotnet pack` produces."""
    files = ("README.md", "lib/netstandard2.0/Nep.dll", "lib/netstandard2.0/Nep.xml", "_rels/.rels")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("Nep.nuspec", nuspec)
        for name in files:
            if name != leaves_out:
                archive.writestr(name, "")


def test_incomplete_nuget_package_is_rejected(tmp_path: Path) -> None:
    package = tmp_path / "Nep.0.1.0.nupkg"
    write_nuget(package)
    check_nuget(package)
    write_nuget(package, leaves_out="lib/netstandard2.0/Nep.xml")
    with pytest.raises(PackageError, match=r"Nep\.xml"):
        check_nuget(package)
    write_nuget(package, NUSPEC.replace("Newtonsoft.Json", "Other").replace("authors", "owners"))
    with pytest.raises(PackageError, match=r"authors, dependency Newtonsoft\.Json"):
        check_nuget(package)


@pytest.mark.skipif(sys.platform == "win32", reason="the stand-in for dotnet is a shell script")
def test_only_the_nuget_package_just_built_is_returned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cp = shutil.which("cp")
    dotnet, source, target = tmp_path / "dotnet", tmp_path / "source", tmp_path / "target"
    source.mkdir()
    target.mkdir()
    (target / "Nep.0.0.9.nupkg").touch()
    write_nuget(tmp_path / "built")
    dotnet.write_text(
        f'#!/bin/sh\n[ "$1" = pack ] && {cp} "{tmp_path}/built" "{target}/Nep.0.1.0.nupkg"\n', "utf-8"
    )
    dotnet.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert pack_nuget(source, target) == [target / "Nep.0.1.0.nupkg"]
    dotnet.write_text("#!/bin/sh\necho no such project >&2; exit 1\n", "utf-8")
    with pytest.raises(PackageError, match="no such project"):
        pack_nuget(source, target)
