"""Removal of FFmpeg from OpenCV, which is linked with it although Studio plays no video.

The loader requires a file with the imported symbols for each library that `cv2` is linked with, so
FFmpeg is replaced by empty libraries. Their functions are never called, because the entry points
disable that part of OpenCV (`installers/entries`). Libraries that only FFmpeg uses are removed. The
package is 35 MB smaller and doesn't need security updates of FFmpeg. Requires gcc and readelf.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path

from installers.context import Context, PackageError
from installers.shared_libraries import remove_dead_links, remove_unneeded, size_of

__all__ = ["FFMPEG_LIBRARIES", "remove_ffmpeg"]

FFMPEG_LIBRARIES = re.compile(r"lib(?:av(?:codec|format|util)|sw(?:scale|resample))-[0-9a-f]+\.so\.")
_IMPORTED = re.compile(r"\b(FUNC|OBJECT|NOTYPE)\s+\w+\s+\w+\s+UND\s+(\w+)@(\w+)")
_NEEDED = re.compile(r"\(NEEDED\)\s+Shared library: \[([^\]]+)\]")


def remove_ffmpeg(context: Context) -> int:
    """Replace FFmpeg's libraries by empty ones; return the number of bytes saved.

    Raises:
        PackageError: A tool is missing or a step has failed.
    """
    internal = context.frozen / "_internal"
    folder = internal / "opencv_python_headless.libs"
    missing = [tool for tool in ("gcc", "readelf") if shutil.which(tool) is None]
    if missing:
        raise PackageError(f"'{missing[0]}' is missing; try: apt-get install gcc binutils")
    before = size_of(folder)
    users = [internal / "cv2" / "cv2.abi3.so"]
    ffmpeg = [path for path in sorted(folder.iterdir()) if FFMPEG_LIBRARIES.match(path.name)]
    imported = _imported_by(users)
    needed = {name for user in users for name in _needed_by(user)}
    for path in ffmpeg:
        if path.name not in needed:
            path.unlink()
            continue
        _make_empty(context, path, imported)
    remove_unneeded(folder, users, _needed_by)
    remove_dead_links(internal.iterdir())
    return before - size_of(folder)


def _readelf(option: str, path: Path) -> str:
    return subprocess.run(
        ["readelf", "--wide", option, path], capture_output=True, text=True, check=True
    ).stdout


def _needed_by(path: Path) -> list[str]:
    return _NEEDED.findall(_readelf("--dynamic", path))


def _imported_by(paths: Iterable[Path]) -> Mapping[str, set[str]]:
    # By symbol version, such as LIBAVCODEC_62.
    names_by_version: dict[str, set[str]] = {}
    for path in paths:
        for _kind, name, version in _IMPORTED.findall(_readelf("--dyn-syms", path)):
            names_by_version.setdefault(version, set()).add(name)
    return names_by_version


def _make_empty(context: Context, path: Path, imported: Mapping[str, set[str]]) -> None:
    # A library of the same name whose functions do nothing.
    versions = re.findall(r"Name: (LIB\w+)", _readelf("--version-info", path))
    names_by_version = {version: sorted(imported.get(version, ())) for version in dict.fromkeys(versions)}
    source, script = context.work / "empty.c", context.work / "empty.map"
    names = [name for each in names_by_version.values() for name in each]
    source.write_text("".join(f"long {name}(void) {{ return 0; }}\n" for name in names), "utf-8")
    script.write_text(
        "".join(
            f"{version} {{ global: {' '.join(f'{name};' for name in each)} }};\n"
            if each
            else f"{version} {{ }};\n"
            for version, each in names_by_version.items()
        ),
        "utf-8",
    )
    context.run(
        "gcc", "-shared", "-fPIC", "-O1", "-w", "-fno-builtin", "-nostdlib", "-s", "-Wl,--build-id=none",
        f"-Wl,-soname,{path.name}", f"-Wl,--version-script={script}", "-o", path, source,
    )  # fmt: skip
