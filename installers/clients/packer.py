"""Packages of the client libraries: `nep-js` for npm, `Nep` for NuGet, and the Unity package.

Only the .NET SDK builds the NuGet package: assemblies compiled by `mcs` refer to `mscorlib` instead of
`netstandard`.
"""

from __future__ import annotations

import shutil
import subprocess
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Sequence
from pathlib import Path

from installers.context import Context, PackageError
from tools import unity_package

__all__ = ["build", "check_nuget", "pack_built_javascript", "pack_javascript", "pack_nuget"]


def build(context: Context, *, keep_frozen: bool) -> Sequence[Path]:
    """Build the packages and return their paths.

    A package whose build tool is missing is skipped with a printed message.

    Args:
        context: Version and folders.
        keep_frozen: Ignored.
    """
    del keep_frozen  # the clients aren't frozen
    return [
        *pack_javascript(context.root / "clients" / "javascript", context.dist),
        *pack_nuget(context.root / "clients" / "csharp", context.dist),
        unity_package.build(context.dist),
    ]


def pack_javascript(source: Path, target: Path) -> list[Path]:
    """Build the npm package and return [`nep-js-VERSION.tgz`], or an empty list without npm."""
    npm = shutil.which("npm")
    if npm is None:
        print("· nep-js is skipped: npm, which is part of Node.js, is not installed", flush=True)
        return []
    if not (source / "node_modules" / "typescript").is_dir():
        _run([npm, "ci", "--no-audit", "--no-fund", "--silent"], source)
    shutil.rmtree(source / "dist", ignore_errors=True)  # stale files of renamed modules
    _run([npm, "run", "--silent", "build"], source)
    return [pack_built_javascript(npm, source, target)]


def pack_built_javascript(npm: str, source: Path, target: Path) -> Path:
    """Pack the output of `npm run build` and return the path of the package."""
    pack = [npm, "pack", "--silent", "--ignore-scripts", "--pack-destination", str(target)]
    return target / _run(pack, source).split()[-1]


def pack_nuget(source: Path, target: Path) -> list[Path]:
    """Build the NuGet package and return [`Nep.VERSION.nupkg`], or an empty list without the .NET SDK."""
    dotnet = shutil.which("dotnet")
    if dotnet is None:
        print("· Nep for NuGet is skipped: the .NET SDK is not installed", flush=True)
        return []
    for old in target.glob("Nep.*.nupkg"):
        old.unlink()
    _run([dotnet, "pack", "Nep.csproj", "--configuration", "Release", "--output", str(target)], source)
    packages = sorted(target.glob("Nep.*.nupkg"))
    for package in packages:
        check_nuget(package)
    return packages


def check_nuget(package: Path) -> None:
    """Raise `PackageError` if the package lacks a file, or if its manifest lacks an entry."""
    with zipfile.ZipFile(package) as archive:
        names = archive.namelist()
        manifest = archive.read("Nep.nuspec") if "Nep.nuspec" in names else b"<package/>"
    missing = {"Nep.nuspec", "README.md", *(f"lib/netstandard2.0/Nep.{kind}" for kind in ("dll", "xml"))}
    missing -= set(names)
    metadata = {each.tag.rpartition("}")[2]: each for each in ET.fromstring(manifest).iter()}  # noqa: S314 - we built it
    for name in ("id", "version", "authors", "license", "readme", "description"):
        if name not in metadata or not metadata[name].text:
            missing.add(name)
    dependency = metadata.get("dependency")
    if dependency is None or dependency.get("id") != "Newtonsoft.Json":
        missing.add("dependency Newtonsoft.Json")
    if missing:
        raise PackageError(f"{package.name} lacks {', '.join(sorted(missing))}")


def _run(command: Sequence[str], folder: Path) -> str:
    completed = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if completed.returncode:
        raise PackageError(f"'{' '.join(command)}' failed:\n{completed.stdout}{completed.stderr}".rstrip())
    return completed.stdout
