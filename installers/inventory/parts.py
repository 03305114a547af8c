"""Parts of a package with their licences: from Python, Qt and the block editor."""

from __future__ import annotations

import platform
import re
import sys
import sysconfig
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

__all__ = [
    "LICENCES",
    "PROJECT",
    "QT_WHEELS",
    "InventoryError",
    "Part",
    "Texts",
    "editor_parts",
    "other_parts",
    "own_text",
    "parts_of",
]

PROJECT, EXTRA = "nep-studio", "studio"
LICENCES = Path(__file__).resolve().parent / "licences"
LICENCE_FILE = re.compile(r"(?:^|[/._-])(?:licen[cs]es?|copying|notice|authors|legal)\b", re.IGNORECASE)
TEXT_SUFFIX = re.compile(r"(?:\.(?:txt|md|rst|bsd|apache2?|html|\d))?$", re.IGNORECASE)
"""Pattern for the file suffix of a licence text. LICENSE-MPL-2.0 has the suffix ".0" in this sense."""
QT_WHEELS = ("pyside6", "pyside6-addons", "pyside6-essentials", "shiboken6")
LGPL = "LGPL-3.0-only"
EDITOR_PART = re.compile(r"^(@?[\w./-]+) (\d[\w.-]*) \(([^)\n]+)\)$", re.MULTILINE)

Texts = Sequence[tuple[str, "Path | str"]]
"""Licence texts: pairs of a file name and either the path of the file or the text itself."""


class InventoryError(Exception):
    """Raised if parts without a known licence are found; the message has a line for each."""


@dataclass(frozen=True)
class Part:
    """Part of a package with its licence.

    Attributes:
        name: Name of the part.
        version: Version, or "" if unknown.
        licence: SPDX expression, or name of the licence.
        texts: Licence texts.
        kind: Type of the part's package URL, such as "pypi" or "npm".
        within: Name of the part into which this part is compiled, or "".
        authors: Authors, or "".
    """

    name: str
    version: str
    licence: str
    texts: Texts = ()
    kind: str = "pypi"
    within: str = ""
    authors: str = ""


RIGHTS = {"mcap": ("Copyright (c) Foxglove Technologies Inc.", "MIT")}
"""Copyright line and licence of distributions whose wheels lack a licence text."""


def own_text(copyright_lines: str, *licences: str) -> Texts:
    """Return a licence text from copyright lines and the standard texts in `LICENCES`.

    Raises:
        OSError: The text of a licence is missing.
    """
    texts = [(LICENCES / f"{each}.txt").read_text("utf-8").strip("\n") for each in licences]
    return (("LICENSE.txt", "\n\n".join([copyright_lines, *texts]) + "\n"),)


def parts_of(project: str = PROJECT, extra: str = EXTRA) -> Iterator[Part]:
    """Yield a project and all its dependencies on this system, each once.

    Args:
        project: Name of the distribution.
        extra: Extra whose dependencies are included.
    """
    pending, seen = [Requirement(f"{project}[{extra}]")], set[tuple[str, frozenset[str]]]()
    yielded = set[str]()
    while pending:
        requirement = pending.pop(0)
        name = canonicalize_name(requirement.name)
        if (name, frozenset(requirement.extras)) in seen:
            continue
        seen.add((name, frozenset(requirement.extras)))
        distribution = metadata.distribution(name)
        for line in distribution.requires or ():
            needed = Requirement(line)
            if needed.marker is None or any(
                needed.marker.evaluate({"extra": each}) for each in ("", *requirement.extras)
            ):
                pending.append(needed)
        if name not in yielded:
            yielded.add(name)
            licence = _licence(distribution)
            yield Part(
                name,
                distribution.version,
                licence,
                tuple(_texts(distribution)) or _common_text(licence, name),
            )


def _licence(distribution: metadata.Distribution) -> str:
    # Prefers an SPDX expression.
    declared = (
        distribution.metadata.get_all("License-Expression") or distribution.metadata.get_all("License") or []
    )
    classes = [
        each.rpartition(" :: ")[2]
        for each in distribution.metadata.get_all("Classifier") or ()
        if each.startswith("License :: ")
    ]
    short = [each for each in declared if each and len(each) < 100 and "\n" not in each]
    return str(short[0]) if short else " OR ".join(classes)


def _common_text(licence: str, name: str) -> Texts:
    # Standard text for a distribution without one, if available.
    if name in RIGHTS:
        return own_text(*RIGHTS[name])
    if name in QT_WHEELS or "apache" not in licence.lower():
        return ()
    text = LICENCES / "Apache-2.0.txt"
    return ((text.name, text),)


def _texts(distribution: metadata.Distribution) -> Iterator[tuple[str, Path]]:
    # Names are relative to the distribution's folder.
    if canonicalize_name(distribution.metadata["Name"]) in QT_WHEELS:
        return
    for file in distribution.files or ():
        path = Path(str(distribution.locate_file(file)))
        is_text = TEXT_SUFFIX.fullmatch(file.suffix) is not None
        is_top_level = ".dist-info" in file.parts[0] or len(file.parts) <= 2
        if is_text and is_top_level and LICENCE_FILE.search("/".join(file.parts[-2:])) and path.is_file():
            yield "-".join(each for each in file.parts[1:] if each != "licenses"), path


def other_parts(resources: Path) -> Iterator[Part]:
    """Yield the parts that aren't Python dependencies.

    These are CPython, Qt, PyInstaller's boot loader, npm packages, fonts and icons.

    Args:
        resources: Folder of the project's resources.
    """
    yield Part("cpython", platform.python_version(), "PSF-2.0", _texts_of_python(), "generic")
    qt = metadata.version("PySide6-Essentials")
    qt_texts = [(each.name, each) for each in sorted(LICENCES.glob("*GPL-3*"))]
    yield Part("qt", qt, LGPL, qt_texts, "generic")
    loader = metadata.distribution("pyinstaller")
    yield Part(
        "pyinstaller", loader.version, "GPL-2.0-or-later WITH Bootloader-exception", tuple(_texts(loader))
    )
    yield from editor_parts(resources / "blockly" / "LEGAL.txt")
    fonts = resources / "fonts"
    for name in ("Inter", "JetBrainsMono", "MPLUS1p"):
        text = fonts / f"LICENSE-{name}.txt"
        yield Part(name.lower(), "", "OFL-1.1", [(text.name, text)], "generic")
    icons = resources / "icons" / "LICENSE.txt"
    yield Part("lucide", "", "ISC", [(icons.name, icons)], "npm")


def _texts_of_python(base: Path = Path(sys.base_prefix)) -> Texts:
    # The interpreter's own text, which on Windows includes bundled libraries; Debian has none, so ours is
    # used.
    candidates = (
        base / "LICENSE.txt",
        Path(sysconfig.get_path("stdlib", vars={"installed_base": str(base)})) / "LICENSE.txt",
    )
    return [("LICENSE.txt", next(filter(Path.is_file, candidates), LICENCES / "PSF-2.0.txt"))]


def editor_parts(legal: Path) -> Iterator[Part]:
    """Yield the npm packages in the block editor's page.

    Args:
        legal: File in which the bundler lists the packages with their licences.
    """
    for match in EDITOR_PART.finditer(legal.read_text("utf-8")):
        yield Part(match[1], match[2], match[3], [(legal.name, legal)], "npm")
