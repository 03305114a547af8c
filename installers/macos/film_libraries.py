"""Removal of FFmpeg from OpenCV, as on Linux (`installers.linux.film_libraries`).

OpenCV's wheels contain an FFmpeg with x264 and x265, on Apple silicon also Rubber Band and vid.stab, which
are under the GNU General Public License. Studio plays no video, so FFmpeg is replaced by empty libraries, and
libraries that only FFmpeg uses are removed. The entry points disable that part of OpenCV (`entries`).
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping
from pathlib import Path

from installers.context import Context, PackageError, this_system
from installers.macos.information import OLDEST_MACOS
from installers.macos.layout import binaries
from installers.macos.mach_o import read
from installers.shared_libraries import remove_dead_links, remove_unneeded, size_of

__all__ = ["FFMPEG_LIBRARIES", "remove_ffmpeg"]

FFMPEG_LIBRARIES = re.compile(r"lib(?:av(?:codec|device|filter|format|util)|sw(?:scale|resample)|postproc)\.")
_IMPORTED = re.compile(r"\(undefined\).* external _(\w+) \(from (lib\w+)")


def remove_ffmpeg(context: Context, app: Path) -> int:
    """Replace FFmpeg's libraries by empty ones; return the bytes saved, 0 if there are none.

    Raises:
        PackageError: A step has failed or the compiler is missing. If FFmpeg remained in the package,
            the whole package would have to be under FFmpeg's licence.
    """
    ffmpeg = [path for path in binaries(app) if FFMPEG_LIBRARIES.match(path.name)]
    if not ffmpeg:
        return 0
    folder = ffmpeg[0].parent
    user = folder.parent / "cv2.abi3.so"
    if {path.parent for path in ffmpeg} != {folder} or not user.is_file():
        raise PackageError(f"FFmpeg is in an unexpected folder: '{folder}'")
    before = size_of(folder)
    imported = _imported_by(user)
    needed = _needed_by(user)
    for path in ffmpeg:
        if path.name in needed:
            _make_empty(context, path, imported.get(path.name.split(".")[0], set()))
        else:
            path.unlink()
    remove_unneeded(folder, [user], _needed_by)
    remove_dead_links(sorted(app.rglob("*")))
    return before - size_of(folder)


def _needed_by(path: Path) -> set[str]:
    return {name.rpartition("/")[2] for each in read(path) for name in each.needs}


def _imported_by(path: Path) -> Mapping[str, set[str]]:
    # By the library that they are imported from.
    tool = "nm" if this_system() == "macos" else "llvm-nm"
    try:
        output = subprocess.run([tool, "-m", "-u", path], capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError) as error:
        raise PackageError(f"'{tool}' can't list the imports of '{path.name}': {error}") from error
    names_by_library: dict[str, set[str]] = {}
    for name, library in _IMPORTED.findall(output):
        names_by_library.setdefault(library, set()).add(name)
    return names_by_library


def _make_empty(context: Context, path: Path, names: set[str]) -> None:
    # A library of the same name whose functions do nothing.
    source = context.work / "empty.c"
    source.parent.mkdir(parents=True, exist_ok=True)
    source.write_text("".join(f"long {name}(void) {{ return 0; }}\n" for name in sorted(names)), "utf-8")
    machine = context.machine
    # For tests on other systems: LLVM's linker, without the system library that only a Mac has.
    elsewhere = () if this_system() == "macos" else ("-fuse-ld=lld", "-mlinker-version=705", "-nostdlib")
    context.run(
        "clang", f"--target={machine}-apple-macos{OLDEST_MACOS[machine]}", "-dynamiclib", "-O1",
        "-fno-builtin", *elsewhere, "-install_name", f"@rpath/{path.name}", "-compatibility_version", "999",
        "-current_version", "999", "-o", path, source,
    )  # fmt: skip
