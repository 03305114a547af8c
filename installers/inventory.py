"""What is inside a package, and under which licences: a CycloneDX bill of materials, licence texts, a notice.

Run by the interpreter whose environment is frozen (`installers.package` does that):

    python inventory.py SYSTEM EPOCH FOLDER BILL

FOLDER gets `licences/` and `NOTICE.txt`, BILL is the file of the bill of materials.
"""

from __future__ import annotations

import platform
import re
import sys
import sysconfig
import uuid
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from importlib import metadata
from pathlib import Path

from cyclonedx.contrib.license.factories import LicenseFactory
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.output import make_outputter
from cyclonedx.schema import OutputFormat, SchemaVersion
from packageurl import PackageURL
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

PROJECT, EXTRA = "nep-studio", "studio"
LICENCE_FILE = re.compile(r"(?:^|[/._-])(?:licen[cs]es?|copying|notice|authors|legal)\b", re.IGNORECASE)
QT_WHEELS = ("pyside6", "pyside6-addons", "pyside6-essentials", "shiboken6")
LGPL = "LGPL-3.0-only"
EDITOR_PART = re.compile(r"^(@?[\w./-]+) (\d[\w.-]*) \(([^)\n]+)\)$", re.MULTILINE)
HERE = Path(__file__).resolve().parent
APACHE = HERE / "licences" / "Apache-2.0.txt"


@dataclass(frozen=True)
class Part:
    """One thing inside: its name and version, the licence as SPDX or in words, and its licence texts."""

    name: str
    version: str
    licence: str
    texts: Sequence[tuple[str, Path]] = ()
    kind: str = "pypi"


def parts_of(project: str = PROJECT, extra: str = EXTRA) -> Iterator[Part]:
    """The project with all that it needs on this system, each once."""
    waiting, seen = [Requirement(f"{project}[{extra}]")], set[tuple[str, frozenset[str]]]()
    told = set[str]()
    while waiting:
        wanted = waiting.pop(0)
        name = canonicalize_name(wanted.name)
        if (name, frozenset(wanted.extras)) in seen:
            continue
        seen.add((name, frozenset(wanted.extras)))
        found = metadata.distribution(name)
        for line in found.requires or ():
            needed = Requirement(line)
            if needed.marker is None or any(
                needed.marker.evaluate({"extra": each}) for each in ("", *wanted.extras)
            ):
                waiting.append(needed)
        if name not in told:
            told.add(name)
            licence = _licence(found)
            yield Part(name, found.version, licence, tuple(_texts(found)) or _common_text(licence, name))


def _licence(found: metadata.Distribution) -> str:
    """What it says of its licence: an SPDX expression where it has one."""
    said = found.metadata.get_all("License-Expression") or found.metadata.get_all("License") or []
    classes = [
        each.rpartition(" :: ")[2]
        for each in found.metadata.get_all("Classifier") or ()
        if each.startswith("License :: ")
    ]
    short = [each for each in said if each and len(each) < 100 and "\n" not in each]
    return str(short[0]) if short else " OR ".join(classes)


def _common_text(licence: str, name: str) -> tuple[tuple[str, Path], ...]:
    """For a distribution that comes without: the text, if it is one that we have."""
    if name in QT_WHEELS or "apache" not in licence.lower():
        return ()
    return ((APACHE.name, APACHE),)


def _texts(found: metadata.Distribution) -> Iterator[tuple[str, Path]]:
    """Its licence texts: the name of each below the folder of the distribution, and the file."""
    if canonicalize_name(found.metadata["Name"]) in QT_WHEELS:
        return
    for file in found.files or ():
        path = Path(str(found.locate_file(file)))
        is_text = file.suffix.lower() in {"", ".txt", ".md", ".rst", ".bsd", ".apache", ".html", ".apache2"}
        is_beside = ".dist-info" in file.parts[0] or len(file.parts) <= 2
        if is_text and is_beside and LICENCE_FILE.search("/".join(file.parts[-2:])) and path.is_file():
            yield "-".join(each for each in file.parts[1:] if each != "licenses"), path


def others(resources: Path) -> Iterator[Part]:
    """What is inside and is no distribution of Python's."""
    beside = (Path(sys.base_prefix) / "LICENSE.txt", Path(sysconfig.get_path("stdlib")) / "LICENSE.txt")
    texts = [("LICENSE.txt", each) for each in beside if each.is_file()]
    yield Part("cpython", platform.python_version(), "PSF-2.0", texts[:1], "generic")
    qt = metadata.version("PySide6-Essentials")
    own = [(each.name, each) for each in sorted((HERE / "licences").glob("*GPL-*"))]
    yield Part("qt", qt, LGPL, own, "generic")
    yield Part("pyinstaller", metadata.version("pyinstaller"), "GPL-2.0-or-later WITH Bootloader-exception")
    yield from editor_parts(resources / "blockly" / "LEGAL.txt")
    fonts = resources / "fonts"
    for name in ("Inter", "JetBrainsMono"):
        text = fonts / f"LICENSE-{name}.txt"
        yield Part(name.lower(), "", "OFL-1.1", [(text.name, text)], "generic")
    icons = resources / "icons" / "LICENSE.txt"
    yield Part("lucide", "", "ISC", [(icons.name, icons)], "npm")


def editor_parts(legal: Path) -> Iterator[Part]:
    """What is in the block editor's page, as the bundler wrote it down."""
    for found in EDITOR_PART.finditer(legal.read_text("utf-8")):
        yield Part(found[1], found[2], found[3], [(legal.name, legal)], "npm")


def write_licences(parts: Iterable[Part], folder: Path, version: str) -> None:
    """The folder of licence texts and the notice."""
    made = list(parts)
    for part in made:
        for name, text in part.texts:
            target = folder / "licences" / part.name.replace("/", "-").lstrip("@") / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(text.read_bytes())
    qt = next(part.version for part in made if part.name == "qt")
    notice = (HERE / "notice.txt").read_text("utf-8")
    (folder / "NOTICE.txt").write_text(notice.format(version=version, qt=qt), "utf-8", newline="\n")


def bill(parts: Iterable[Part], system: str, epoch: int, version: str) -> str:
    """The bill of materials as JSON of CycloneDX 1.6; the same parts give the same bill."""
    made = Bom(serial_number=uuid.uuid5(uuid.NAMESPACE_URL, f"{PROJECT}/{version}/{system}/{epoch}"))
    made.metadata.timestamp = datetime.fromtimestamp(epoch, timezone.utc)
    made.metadata.component = _component(Part(PROJECT, version, "MIT"), ComponentType.APPLICATION)
    for part in parts:
        if part.name != PROJECT:
            component = _component(part, ComponentType.LIBRARY)
            made.components.add(component)
            made.register_dependency(made.metadata.component, [component])
    return make_outputter(made, OutputFormat.JSON, SchemaVersion.V1_6).output_as_string(indent=1)


def _component(part: Part, kind: ComponentType) -> Component:
    licences = [LicenseFactory().make_from_string(part.licence)] if part.licence else []
    namespace, _slash, name = part.name.rpartition("/")
    return Component(
        name=part.name,
        version=part.version or None,
        type=kind,
        bom_ref=f"{part.kind}/{part.name}@{part.version}",
        licenses=licences,
        purl=PackageURL(part.kind, namespace or None, name, part.version or None),
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """See the module."""
    system, epoch, folder, bill_file = sys.argv[1:] if arguments is None else arguments
    version = metadata.version(PROJECT)
    parts = [*parts_of(), *others(HERE.parent / "resources")]
    write_licences(parts, Path(folder), version)
    Path(bill_file).write_text(bill(parts, system, int(epoch), version), "utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
