"""Shared libraries of a frozen program; the build fails for a library without a known licence.

PyInstaller collects all libraries that a program is linked with from the build machine. An unknown
library would be distributed without its licence.
"""

from __future__ import annotations

import os
import pyexpat
import re
import shutil
import sqlite3
import ssl
import subprocess
import sys
import sysconfig
import zlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from importlib import metadata
from pathlib import Path, PurePath
from typing import NamedTuple

from installers.inventory.parts import QT_WHEELS, InventoryError, Part, own_text

__all__ = ["LIBRARIES", "Library", "compiled_files", "library_of", "parts_in_folder"]


class Library(NamedTuple):
    """Origin and licence of library files.

    Attributes:
        files: Pattern of the file names without the suffix.
        licence: SPDX expression or name of the licence.
        of: Part that contains the files; if empty, the system package that installed them is a separate
            part.
        rights: Copyright lines for a part without a licence text.
        texts: Names of the standard licence texts for a part without a licence text.
    """

    files: str
    licence: str
    of: str = ""
    rights: str = ""
    texts: tuple[str, ...] = ()
    version: str = ""
    """Pattern that extracts the version from the file name."""
    is_of_system: bool = False
    """True if an installed system package takes precedence over `rights` and `texts`."""


_X = "X11"
_EXTENSION = r"(?:\.so(?:\.[\d.]+)?|(?:\.[\d.]+)?\.dylib|\.dll)"
LIBRARIES = (
    # bundled in wheels
    Library(r"libzmq(?:-[\w.-]+?)?", "MPL-2.0", "libzmq"),
    Library(r"libsodium(?:-[\w.-]+?)?", "ISC", "libsodium"),
    Library(r"libscipy_openblas\w*(?:-\w+)?", "BSD-3-Clause", "openblas"),
    Library(r"libopenblas[\w-]*(?:\.[\d.]+)?", "BSD-3-Clause", "openblas"),
    Library(
        r"lib(?:gfortran|gcc_s)[\w.-]*?", "GPL-3.0-or-later WITH GCC-exception-3.1", "gcc-runtime-library"
    ),
    Library(r"libquadmath[\w.-]*?", "LGPL-2.1-or-later", "libquadmath"),
    Library(r"libpng16(?:-\w+)?", "libpng-2.0", "libpng"),
    Library(r"libavif(?:-\w+)?", "BSD-2-Clause", "libavif"),
    Library(
        r"libaom(?:-\w+)?",
        "BSD-2-Clause",
        "libaom",
        "Copyright (c) 2016, Alliance for Open Media. All rights reserved.",
        ("BSD-2-Clause", "AOM-patent"),
        r"[.-](\d+\.\d+\.\d+)\b",
    ),
    Library(
        r"libvmaf",
        "BSD-2-Clause-Patent",
        "libvmaf",
        "Copyright (c) 2020 Netflix, Inc.",
        ("BSD-2-Clause-Patent",),
    ),
    # bundled in the wheels of Qt
    Library(r"libicu(?:data|i18n|uc)", "Unicode-3.0", "icu", "", ("Unicode-3.0",), r"\.so\.(\d+)"),
    Library(r"(?:lib)?(?:pyside6(?:qml)?|shiboken6)\.abi3(?:\.[\d.]+)?", "LGPL-3.0-only", "qt"),
    Library(
        r"opengl32sw",
        "MIT",
        "mesa",
        "Copyright (C) 1999-2007  Brian Paul   All Rights Reserved.\n"
        "Includes LLVM, under the Apache License with LLVM exceptions: https://llvm.org/LICENSE.txt",
        ("MIT", "Apache-2.0"),
    ),
    # part of Python and Windows; on Linux from system packages
    Library(r"(?:lib)?python3[\d.]*t?", "PSF-2.0", "cpython"),
    Library(
        r"(?:msvcp|vcruntime|concrt|vcamp|vccorlib|vcomp)140[\w-]*|ucrtbase|api-ms-win-[\w-]+",
        "Microsoft Visual C++ Redistributable",
        "microsoft-visual-cpp-runtime",
        "Copyright (c) Microsoft Corporation. All rights reserved.\n\n"
        "These files may be redistributed unchanged with programs that need them:\n"
        "https://learn.microsoft.com/cpp/windows/redistributing-visual-cpp-files",
    ),
    Library(
        r"lib(?:ssl|crypto)(?:-3[\w-]*)?",
        "Apache-2.0",
        "openssl",
        "Copyright (c) 1998-2025 The OpenSSL Project Authors",
        ("Apache-2.0",),
        is_of_system=True,
    ),
    Library(
        r"libffi(?:-\d+)?",
        "MIT",
        "libffi",
        "Copyright (c) 1996-2025  Anthony Green, Red Hat, Inc and others.",
        ("MIT",),
        is_of_system=True,
    ),
    Library(
        r"(?:lib)?sqlite3",
        "blessing",
        "sqlite",
        "SQLite is in the public domain: https://sqlite.org/copyright.html",
        is_of_system=True,
    ),
    Library(
        r"libz|zlib1",
        "Zlib",
        "zlib",
        "Copyright (C) 1995-2024 Jean-loup Gailly and Mark Adler",
        ("Zlib",),
        is_of_system=True,
    ),
    Library(
        r"libbz2",
        "bzip2-1.0.6",
        "bzip2",
        "Copyright (C) 1996-2019 Julian R Seward. All rights reserved.",
        ("bzip2-1.0.6",),
        is_of_system=True,
    ),
    Library(
        r"liblzma",
        "0BSD",
        "xz",
        "liblzma of XZ Utils, under the BSD Zero Clause License: it may be used, copied, modified and "
        "distributed for any purpose; it is provided as is, without any warranty.",
        is_of_system=True,
    ),
    Library(
        r"libmpdec(?:\+\+)?",
        "BSD-2-Clause",
        "mpdecimal",
        "Copyright (c) 2008-2024 Stefan Krah. All rights reserved.",
        ("BSD-2-Clause",),
        is_of_system=True,
    ),
    Library(
        r"libexpat",
        "MIT",
        "expat",
        "Copyright (c) 1998-2000 Thai Open Source Software Center Ltd and Clark Cooper\n"
        "Copyright (c) 2001-2025 Expat maintainers",
        ("MIT",),
        is_of_system=True,
    ),
    # Linux: the system packages contain the licence texts
    Library(r"libX(?:composite|damage|i|inerama|randr|tst|cursor|ss)|libxkbfile|libxshmfence", _X),
    Library(r"libxcb(?:-[a-z0-9]+)*", _X),
    Library(r"libxkbcommon(?:-x11)?|libwayland-\w+", "MIT"),
    Library(r"libbrotli(?:common|dec|enc)|libcom_err", "MIT"),
    Library(r"lib(?:gssapi_krb5|k5crypto|krb5|krb5support)", "MIT"),
    Library(r"libkeyutils", "LGPL-2.1-or-later"),
    Library(r"lib(?:nspr4|plc4|plds4|smime3|softokn3|ssl3)|libnss\w+|libfreebl\w+", "MPL-2.0"),
    Library(r"liblz4", "BSD-2-Clause"),
    Library(r"libzstd", "BSD-3-Clause"),
    Library(r"libtinfo|libncursesw?|libpanelw?", "X11-distribute-modifications-variant"),
    Library(r"libtirpc|libnsl|libedit|libbsd|libmd", "BSD-3-Clause"),
    Library(r"libcrypt", "LGPL-2.1-or-later"),
)  # fmt: skip
"""Known libraries, identified by patterns of their file names without the suffix and version numbers."""
_PATTERNS = [(re.compile(f"(?:{each.files}){_EXTENSION}", re.IGNORECASE), each) for each in LIBRARIES]
_VERSIONS_IN_PYTHON = {
    "expat": pyexpat.EXPAT_VERSION.rpartition("_")[2],
    "openssl": ssl.OPENSSL_VERSION.split()[1],
    "sqlite": sqlite3.sqlite_version,
    "zlib": zlib.ZLIB_RUNTIME_VERSION,
}
"""Versions of libraries as reported by the interpreter that is frozen."""
_FFMPEG_LIBRARY = re.compile(
    r"lib(?:av(?:codec|device|filter|format|util)|sw(?:scale|resample)|postproc)[.-]"
)
"""Names of FFmpeg's libraries, for which the package contains empty replacements (film_libraries.py)."""
_MAX_EMPTY_LIBRARY_BYTES = 96 * 1024
_QT = re.compile(r"(?:lib)?Qt\w*(?:\.framework)?\b|QtWebEngineProcess")
_OWN_PROGRAMS = frozenset({"nep", "nep-studio", "nep.exe", "nep-studio.exe"})
_MAGIC = (b"\x7fELF", b"\xcf\xfa\xed\xfe", b"\xce\xfa\xed\xfe", b"\xca\xfe\xba\xbe", b"\xca\xfe\xba\xbf")


def compiled_files(folder: Path) -> Iterator[Path]:
    """Yield the binaries of any system in a folder in sorted order, without following links."""
    for root, folders, names in os.walk(folder):
        folders.sort()
        for path in (Path(root, name) for name in sorted(names)):
            if not path.is_symlink():
                with path.open("rb") as file:
                    magic = file.read(4)
                if magic in _MAGIC or magic[:2] == b"MZ":
                    yield path


def library_of(name: str) -> Library | None:
    """Return the element of `LIBRARIES` for a file name, or None if the library is unknown."""
    return next((library for pattern, library in _PATTERNS if pattern.fullmatch(name)), None)


def parts_in_folder(folder: Path, known_parts: Sequence[Part]) -> Iterator[Part]:
    """Yield the parts of the libraries in a frozen program's folder.

    Args:
        folder: Folder of the frozen program.
        known_parts: Parts that are known already; they are not yielded again.

    Raises:
        InventoryError: Libraries are unknown or have no licence text; the message has a line for each.
    """
    wheel_names = _known_files({each.name for each in known_parts if each.kind == "pypi"})
    names, problems, libraries = {each.name for each in known_parts}, list[str](), dict[str, Library]()
    for path in compiled_files(folder):
        library = library_of(path.name)
        if library is not None:
            if library.of not in names:
                libraries[path.name] = library
        elif not _is_known_file(path, wheel_names):
            problems.append(f"'{path.relative_to(folder)}' has no known origin: add it to LIBRARIES")
    parts_by_name = dict[str, Part]()
    packages = _debian_packages(
        name for name, library in libraries.items() if library.is_of_system or not library.of
    )
    for name, library in libraries.items():
        part = packages[name].part(library) if name in packages else _part_of_library(name, library)
        if part is None:
            problems.append(f"'{name}' belongs to no package of this system, so its licence text is missing")
        else:
            parts_by_name.setdefault(part.name, part)
    if problems:
        raise InventoryError("\n".join(problems))
    yield from parts_by_name.values()


class _KnownFiles(NamedTuple):
    extensions: frozenset[str]
    qt: frozenset[str]
    python: frozenset[str]


def _known_files(names: Collection[str]) -> _KnownFiles:
    extensions, qt = set[str](), set[str]()
    for name in names:
        for file in metadata.distribution(name).files or ():
            if name in QT_WHEELS and (_QT.match(file.name) or "plugins" in file.parts):
                qt.add(file.name)
            elif _is_extension(file):
                extensions.add(file.name)
    base = Path(sys.base_prefix)
    folders = (Path(sysconfig.get_path("stdlib")) / "lib-dynload", base / "DLLs", base)
    python = {
        path.name for each in folders if each.is_dir() for path in each.iterdir() if _is_extension(path)
    }
    return _KnownFiles(frozenset(extensions), frozenset(qt), frozenset(python))


def _is_extension(path: PurePath) -> bool:
    # True for Python extension modules, not for libraries in wheels.
    return path.suffix in {".pyd", ".so"} and not path.name.startswith("lib")


def _is_known_file(path: Path, wheel_names: _KnownFiles) -> bool:
    # True for Studio's programs, known extension modules, Qt's files and the empty FFmpeg libraries.
    if path.name in _OWN_PROGRAMS or path.name in wheel_names.extensions or path.name in wheel_names.qt:
        return True
    if path.name in wheel_names.python or (path.name == "Python" and "Python.framework" in path.parts):
        return True
    return _FFMPEG_LIBRARY.match(path.name) is not None and path.stat().st_size < _MAX_EMPTY_LIBRARY_BYTES


def _part_of_library(name: str, library: Library) -> Part | None:
    # From the table above; None without a licence text.
    if not (library.rights or library.texts):
        return None
    match = re.search(library.version, name) if library.version else None
    version = match[1] if match else _VERSIONS_IN_PYTHON.get(library.of, "")
    text = own_text(library.rights, *library.texts)
    return Part(library.of, version, library.licence, text, "generic")


class _DebianPackage(NamedTuple):
    """Debian or Ubuntu package that installed a library."""

    name: str
    version: str
    text: Path

    def part(self, library: Library) -> Part:
        return Part(self.name, self.version, library.licence, (("copyright", self.text),), _system_kind())


def _debian_packages(names: Iterable[str]) -> Mapping[str, _DebianPackage]:
    # Packages of this computer with libraries of these names; empty without dpkg.
    patterns = [f"*/{name}" for name in names]
    if not patterns or shutil.which("dpkg-query") is None:
        return {}
    output = subprocess.run(
        ["dpkg-query", "--search", *patterns], capture_output=True, text=True, check=False
    ).stdout
    # "libssl3:amd64, other: /usr/lib/x86_64-linux-gnu/libssl.so.3"; the shortest path is that of the system
    lines = sorted((line.partition(": ") for line in output.splitlines()), key=lambda each: -len(each[2]))
    by_name = {
        path.rpartition("/")[2]: packages.partition(",")[0].partition(":")[0]
        for packages, _colon, path in lines
    }
    command = ["dpkg-query", "--show", "--showformat=${Package} ${Version}\n", *sorted(set(by_name.values()))]
    output = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    versions = dict(line.split(" ", 1) for line in output.splitlines())
    packages_by_name = {
        name: _DebianPackage(package, versions.get(package, ""), Path("/usr/share/doc", package, "copyright"))
        for name, package in by_name.items()
    }
    return {name: package for name, package in packages_by_name.items() if package.text.is_file()}


def _system_kind() -> str:
    # Start of the package URL: "deb/debian" or "deb/ubuntu".
    try:
        release = Path("/etc/os-release").read_text("utf-8")
    except OSError:
        return "deb"
    match = re.search(r'^ID="?([a-z]+)"?$', release, re.MULTILINE)
    return f"deb/{match[1]}" if match else "deb"
