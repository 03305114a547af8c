"""Parts compiled into wheels: C and C++ libraries, and Rust crates.

If a wheel has a bill of materials (PEP 770), its parts are read from there. For each other wheel with
compiled parts, a function in this module reads the versions from the installed files.
"""

from __future__ import annotations

import json
import mmap
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import lz4  # type: ignore[import-untyped]
import numpy as np
import zmq
import zstandard
from packaging.utils import canonicalize_name
from pynng import lib as nng  # type: ignore[import-untyped]

from installers.inventory.parts import LICENCES, InventoryError, Part, Texts, own_text

__all__ = ["parts_in_wheels", "parts_of_build", "parts_of_crates", "version_in"]

COMPILED = (".so", ".pyd", ".dll", ".dylib")
NUMPY_PART = re.compile(
    r"^Name: (.+)\nFiles: .+\nDescription: .+\nAvailability: .+\nLicense: (.+)$", re.MULTILINE
)
WEB_ENGINE = re.compile(r"(?:lib)?Qt6?WebEngineCore(?:\.so\.\d+|\.dll)?")
BUILD = re.compile(rb"General configuration for OpenCV[^\0]+")
CRATE = re.compile(rb"registry[/\\]src[/\\][^/\\]+[/\\]([A-Za-z0-9_-]+?)-(\d+\.\d+\.\d+[A-Za-z0-9.+-]*)[/\\]")
CRATES = {
    "arc-swap": "MIT OR Apache-2.0",
    "libc": "MIT OR Apache-2.0",
    "once_cell": "MIT OR Apache-2.0",
    "pyo3": "MIT OR Apache-2.0",
    "pyo3-ffi": "MIT OR Apache-2.0",
    "pyo3-log": "Apache-2.0 OR MIT",
    "serde_core": "MIT OR Apache-2.0",
    "sha1_smol": "BSD-3-Clause",
    "toml": "MIT OR Apache-2.0",
    "toml_datetime": "MIT OR Apache-2.0",
    "toml_parser": "MIT OR Apache-2.0",
    "toml_writer": "MIT OR Apache-2.0",
    "winnow": "MIT",
}
"""Licences of the crates in iceoryx2, whose wheel has no bill of materials.

The versions are in its library.
"""


class Bundled(NamedTuple):
    """Library that is compiled into OpenCV.

    Attributes:
        name: Usual name.
        licence: SPDX expression, or name of the licence.
        version: Pattern that extracts the version from OpenCV's build information, or "".
        rights: Copyright lines, for use with `texts`.
        texts: Names of standard licence texts; empty if OpenCV's third-party licences contain the text.
    """

    name: str
    licence: str
    version: str = ""
    rights: str = ""
    texts: tuple[str, ...] = ()


IN_OPENCV: Mapping[str, Bundled | None] = {
    "ade": Bundled("ade", "Apache-2.0", texts=("Apache-2.0",), rights="Copyright (c) Intel Corporation"),
    "avif": Bundled(
        "libavif",
        "BSD-2-Clause",
        r"AVIF:\s+avif \(ver ([\d.]+)\)",
        "Copyright 2019 Joe Drago\nCopyright 2018-2019, VideoLAN and dav1d authors\n"
        "Copyright 2018, Two Orioles, LLC\nCopyright 2022 Google LLC",
        ("BSD-2-Clause",),
    ),
    "flatbuffers": Bundled(
        "flatbuffers",
        "Apache-2.0",
        r"Flatbuffers:\s+builtin/3rdparty \(([\d.]+)\)",
        "Copyright Google Inc.",
        ("Apache-2.0",),
    ),
    "IlmImf": Bundled(
        "openexr",
        "BSD-3-Clause",
        r"OpenEXR:\s+build \(ver ([\d.]+)\)",
        "Copyright (c) 2002-2018, Industrial Light & Magic, a division of Lucas Digital Ltd. LLC\n"
        "Copyright (c) 2009-2014, DreamWorks Animation LLC\nCopyright (c) 2007-2013, Weta Digital Ltd\n"
        "Copyright (c) 2012, Autodesk, Inc.\nCopyright (c) 2004, Pixar Animation Studios",
        ("BSD-3-Clause",),
    ),
    "ippicv": Bundled(
        "ipp-icv",
        "Intel Simplified Software License",
        r"Intel IPP:\s+([\d.]+)",
        "Intel(R) Integrated Performance Primitives (Intel(R) IPP): Copyright (C) Intel Corporation",
        ("ISSL",),
    ),
    "ippiw": None,  # part of Intel IPP
    "ipphal": None,  # OpenCV's own
    "ittnotify": Bundled(
        "ittapi",
        "BSD-3-Clause OR GPL-2.0-only",
        r"Intel ITT\(([\d.]+)\)",
        "Copyright (c) Intel Corporation. All rights reserved.",
        ("BSD-3-Clause",),
    ),
    "kleidicv": Bundled(
        "kleidicv",
        "Apache-2.0",
        r"KleidiCV \(ver ([\d.]+)\)",
        "Copyright Arm Limited and/or its affiliates",
        ("Apache-2.0",),
    ),
    "kleidicv_hal": None,
    "kleidicv_thread": None,
    "libjpeg-turbo": Bundled(
        "libjpeg-turbo",
        "IJG AND BSD-3-Clause AND Zlib",
        r"libjpeg-turbo \(ver ([\d.]+)",
        "This software is based in part on the work of the Independent JPEG Group.\n"
        "Copyright (C) 1991-2020, Thomas G. Lane, Guido Vollbeding\n"
        "Copyright (C) 2009-2025, D. R. Commander\nCopyright (C) 1999-2006, MIYASAKA Masaru\n"
        "Copyright (C) 2015, Viktor Szathmáry",
        ("IJG", "BSD-3-Clause", "Zlib"),
    ),
    "libopenjp2": Bundled("openjpeg", "BSD-2-Clause", r"JPEG 2000:\s+build \(ver ([\d.]+)\)"),
    "libpng": Bundled("libpng", "libpng-2.0", r"PNG:\s+(?:build|\S+) \(ver ([\d.]+)\)"),
    "libprotobuf": Bundled(
        "protobuf",
        "BSD-3-Clause",
        r"Protobuf:\s+build \(([\d.]+)\)",
        "Copyright 2008 Google Inc. All rights reserved.",
        ("BSD-3-Clause",),
    ),
    "libtiff": Bundled(
        "libtiff",
        "libtiff",
        r"TIFF:\s+build \(ver \d+ - ([\d.]+)\)",
        "Copyright (c) 1988-1997 Sam Leffler\nCopyright (c) 1991-1997 Silicon Graphics, Inc.",
        ("libtiff",),
    ),
    "libwebp": Bundled(
        "libwebp",
        "BSD-3-Clause",
        rights="Copyright (c) 2010, Google Inc. All rights reserved.",
        texts=("BSD-3-Clause",),
    ),
    "tegra_hal": Bundled(
        "carotene",
        "BSD-3-Clause",
        r"carotene \(ver ([\d.]+)",
        "Copyright (C) 2012-2016, NVIDIA Corporation, all rights reserved.",
        ("BSD-3-Clause",),
    ),
    "zlib": Bundled("zlib", "Zlib", r"ZLib:\s+build \(ver ([\d.]+)\)"),
}
"""Libraries in OpenCV by their names in its build information.

None for parts of OpenCV itself or of another entry.
"""


def version_in(path: Path, pattern: bytes) -> str:
    """Return the first group of a pattern in a file of any size, or "" if the pattern isn't found."""
    if path.stat().st_size == 0:
        return ""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        match = re.search(pattern, content)
        return match[1].decode() if match else ""


def parts_in_wheels(parts: Iterable[Part]) -> Iterator[Part]:
    """Yield the parts compiled into the given distributions.

    Raises:
        InventoryError: A compiled part is unknown.
    """
    for part in parts:
        if part.kind != "pypi":
            continue
        distribution = metadata.distribution(part.name)
        yield from _crates_of(distribution, part.name)
        if part.name in _KNOWN:
            yield from _KNOWN[part.name](distribution)


def parts_of_crates(bill: Mapping[str, Any], within: str) -> Iterator[Part]:
    """Yield the crates of a bill of materials from Cargo, without build dependencies.

    Args:
        bill: Content of the bill of materials.
        within: Name of the distribution that contains the crates.

    Raises:
        InventoryError: A crate has no licence.
    """
    for component in bill.get("components", ()):
        if str(component.get("purl", "")).startswith("pkg:cargo/") and component.get("scope") != "excluded":
            licence_entry: Mapping[str, Any] = next(iter(component.get("licenses", ())), {})
            licence = licence_entry.get("expression") or licence_entry.get("license", {}).get("id", "")
            if not licence:
                raise InventoryError(f"the crate '{component['name']}' in {within} has no licence")
            authors = str(component.get("author", ""))
            yield Part(component["name"], component["version"], licence, (), "cargo", within, authors)


def parts_of_build(build_info: str, licence_texts: Texts) -> Iterator[Part]:
    """Yield the libraries listed in OpenCV's build information.

    Args:
        build_info: Build information.
        licence_texts: OpenCV's third-party licence text.

    Raises:
        InventoryError: A library is not in `IN_OPENCV`.
    """
    names = _words(build_info, "3rdparty dependencies")
    names += [each for each in _words(build_info, "Extra dependencies") if each == "avif"]
    names += [
        name for name, line in (("flatbuffers", "Flatbuffers:  "), ("libpng", "PNG: ")) if line in build_info
    ]
    for name in dict.fromkeys(names):
        if name not in IN_OPENCV:
            raise InventoryError(f"OpenCV contains '{name}': add it with its licence to IN_OPENCV")
        library = IN_OPENCV[name]
        if library is not None:
            match = re.search(library.version, build_info) if library.version else None
            texts = own_text(library.rights, *library.texts) if library.texts else licence_texts
            version = match[1] if match else ""
            yield Part(library.name, version, library.licence, texts, "generic", "opencv-python-headless")


def _words(build_info: str, line: str) -> list[str]:
    match = re.search(rf"{line}:(.*)", build_info)
    return match[1].split() if match else []


def _compiled_files(distribution: metadata.Distribution) -> Iterator[Path]:
    for file in distribution.files or ():
        path = Path(str(distribution.locate_file(file)))
        if (file.suffix in COMPILED or ".so." in file.name) and path.is_file():
            yield path


def _licence_text(distribution: metadata.Distribution, name: str) -> Texts:
    # The topmost file of this name. Raises InventoryError.
    candidates = [
        file for file in distribution.files or () if file.name == name and ".dist-info" in file.parts[0]
    ]
    if not candidates:
        raise InventoryError(
            f"{distribution.metadata['Name']} no longer contains '{name}': find the new licence file"
        )
    file = min(candidates, key=lambda each: len(each.parts))
    return ((name, Path(str(distribution.locate_file(file)))),)


def _find_version(distribution: metadata.Distribution, pattern: bytes) -> str:
    return next(filter(None, (version_in(path, pattern) for path in _compiled_files(distribution))), "")


def _crates_of(distribution: metadata.Distribution, within: str) -> Iterator[Part]:
    for file in distribution.files or ():
        if "sboms" in file.parts and file.suffix == ".json":
            bill = json.loads(Path(str(distribution.locate_file(file))).read_text("utf-8"))
            yield from parts_of_crates(bill, within)


def _parts_in_iceoryx2(distribution: metadata.Distribution) -> Iterator[Part]:
    crates = {pair for path in _compiled_files(distribution) for pair in CRATE.findall(path.read_bytes())}
    for name, version in sorted((name.decode(), version.decode()) for name, version in crates):
        if name not in CRATES:
            raise InventoryError(f"iceoryx2 contains the crate '{name}': add it with its licence to CRATES")
        yield Part(name, version, CRATES[name], (), "cargo", "iceoryx2")


def _parts_in_numpy(distribution: metadata.Distribution) -> Iterator[Part]:
    # As listed in its licence: OpenBLAS, LAPACK, GCC's Fortran runtime.
    text = _licence_text(distribution, "LICENSE.txt")
    blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]["version"]
    components = NUMPY_PART.findall(Path(text[0][1]).read_text("utf-8"))
    if "OpenBLAS" not in {name for name, _licence in components}:
        raise InventoryError("numpy lists its bundled libraries in another format: update NUMPY_PART")
    for name, licence in components:
        version = str(blas) if name == "OpenBLAS" else ""
        texts = [*text]
        if licence.startswith("LGPL-2.1"):
            texts.append(("LGPL-2.1.txt", LICENCES / "LGPL-2.1.txt"))
        yield Part(canonicalize_name(name.replace(" ", "-")), version, licence, texts, "generic", "numpy")


def _parts_in_opencv(distribution: metadata.Distribution) -> Iterator[Part]:
    build_info = next(
        (
            each[0]
            for each in (BUILD.search(path.read_bytes()) for path in _compiled_files(distribution))
            if each
        ),
        b"",
    )
    if not build_info:
        raise InventoryError("OpenCV's library no longer contains its build information")
    yield from parts_of_build(
        build_info.decode("utf-8", "replace"), _licence_text(distribution, "LICENSE-3RD-PARTY.txt")
    )


def _parts_in_pynng(distribution: metadata.Distribution) -> Iterator[Part]:
    version = f"{nng.NNG_MAJOR_VERSION}.{nng.NNG_MINOR_VERSION}.{nng.NNG_PATCH_VERSION}"
    rights = (
        "Copyright 2018-2025 Staysail Systems, Inc. <info@staysail.tech>\n"
        "Copyright 2018 Capitar IT Group BV <info@capitar.com>\n"
        "Copyright 2018 Devolutions <info@devolutions.net>\n"
        "Copyright 2017 Garrett D'Amore <garrett@damore.org>"
    )
    yield Part("nng", version, "MIT", own_text(rights, "MIT"), "generic", "pynng")
    mbed = _find_version(distribution, rb"Mbed TLS (\d+\.\d+\.\d+)")
    text = own_text("Copyright The Mbed TLS Contributors", "Apache-2.0")
    yield Part("mbedtls", mbed, "Apache-2.0 OR GPL-2.0-or-later", text, "generic", "pynng")


def _parts_in_pyside(distribution: metadata.Distribution) -> Iterator[Part]:
    engine = (
        Path(str(distribution.locate_file(each)))
        for each in distribution.files or ()
        if WEB_ENGINE.fullmatch(each.name)
    )
    versions = (version_in(path, rb"Chrome/(\d+\.\d+\.\d+\.\d+)") for path in engine if path.is_file())
    version = next(filter(None, versions), "")
    text = own_text("Copyright 2015 The Chromium Authors", "BSD-3-Clause")
    yield Part("chromium", version, "BSD-3-Clause", text, "generic", "qt")


def _parts_in_pyzmq(distribution: metadata.Distribution) -> Iterator[Part]:
    zeromq, sodium = (
        _licence_text(distribution, "LICENSE.zeromq.txt"),
        _licence_text(distribution, "LICENSE.libsodium.txt"),
    )
    yield Part("libzmq", zmq.zmq_version(), "MPL-2.0", zeromq, "generic", "pyzmq")
    yield Part(
        "libsodium", _find_version(distribution, rb"\0(1\.0\.\d\d)\0"), "ISC", sodium, "generic", "pyzmq"
    )


def _parts_in_lz4(_distribution: metadata.Distribution) -> Iterator[Part]:
    text = own_text("Copyright (C) 2011-2023, Yann Collet.", "BSD-2-Clause")
    yield Part("lz4-library", lz4.library_version_string(), "BSD-2-Clause", text, "generic", "lz4")


def _parts_in_zstandard(_distribution: metadata.Distribution) -> Iterator[Part]:
    version = ".".join(map(str, zstandard.ZSTD_VERSION))
    text = own_text("Copyright (c) Meta Platforms, Inc. and affiliates. All rights reserved.", "BSD-3-Clause")
    yield Part("zstd", version, "BSD-3-Clause", text, "generic", "zstandard")


_KNOWN: Mapping[str, Callable[[metadata.Distribution], Iterator[Part]]] = {
    "iceoryx2": _parts_in_iceoryx2,
    "lz4": _parts_in_lz4,
    "numpy": _parts_in_numpy,
    "opencv-python-headless": _parts_in_opencv,
    "pynng": _parts_in_pynng,
    "pyside6-addons": _parts_in_pyside,
    "pyzmq": _parts_in_pyzmq,
    "zstandard": _parts_in_zstandard,
}
