"""Bill of materials in CycloneDX, folder of licence texts, and notice of a package."""

from __future__ import annotations

import re
import shutil
import uuid
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path

from cyclonedx.contrib.license.factories import LicenseFactory
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.output import make_outputter
from cyclonedx.schema import OutputFormat, SchemaVersion
from packageurl import PackageURL

from installers.inventory.parts import LICENCES, PROJECT, InventoryError, Part

__all__ = ["bill", "standard_texts", "write_licences"]

NOTICE = LICENCES.parent / "notice.txt"
CRATES_FILE = "rust-crates.txt"
_LICENCE_ALIASES = {"Unicode-DFS-2016": "Unicode-3.0"}
"""Replacements for licences whose wording differs from another licence only in names."""


def write_licences(parts: Iterable[Part], folder: Path, version: str) -> None:
    """Write the licence texts and the notice of a package.

    Args:
        parts: Parts of the package.
        folder: Folder to write to.
        version: Version of Studio.

    Raises:
        InventoryError: A crate has no licence text.
    """
    all_parts = list(parts)
    shutil.rmtree(folder / "licences", ignore_errors=True)
    for part in all_parts:
        for name, text in part.texts:
            within = [each for each in (part.within, part.name) if each]
            target = folder.joinpath(
                "licences", *(each.replace("/", "-").lstrip("@") for each in within), name
            )
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(text.encode() if isinstance(text, str) else text.read_bytes())
    _write_crates([part for part in all_parts if part.kind == "cargo"], folder / "licences")
    qt = next(part.version for part in all_parts if part.name == "qt")
    notice = NOTICE.read_text("utf-8")
    (folder / "NOTICE.txt").write_text(notice.format(version=version, qt=qt), "utf-8", newline="\n")


def _write_crates(crates: Sequence[Part], licences: Path) -> None:
    # Writes a list of all crates with authors, and each licence text once.
    if not crates:
        return
    lines = {
        f"{each.name} {each.version}: {each.licence}"
        + (f"\n    {each.authors}" if each.authors else "")
        + f"\n    in {', '.join(sorted({other.within for other in crates if _key(other) == _key(each)}))}\n"
        for each in crates
    }
    texts = sorted({name for each in crates for name in standard_texts(each)})
    content = "Rust crates, with the packages that they are compiled into. The licence texts follow.\n\n"
    content += "".join(sorted(lines))
    for name in texts:
        content += f"\n---- {name} ----\n\n{(LICENCES / f'{name}.txt').read_text('utf-8').strip()}\n"
    licences.mkdir(parents=True, exist_ok=True)
    (licences / CRATES_FILE).write_text(content, "utf-8", newline="\n")


def standard_texts(part: Part) -> Sequence[str]:
    """Return the names, without suffix, of the files in `LICENCES` that the licence of a part requires.

    For alternatives (OR), all available texts are returned.

    Raises:
        InventoryError: A required text is missing.
    """
    needed = list[str]()
    # Ignores that AND binds more tightly than OR: no crate mixes them without brackets.
    for alternatives in re.split(r"\s+AND\s+", part.licence):
        ids = [
            _LICENCE_ALIASES.get(each, each)
            for each in re.findall(r"[A-Za-z][\w.-]*\d[\w.-]*|MIT|ISC|Zlib", alternatives)
        ]
        available = [each for each in ids if (LICENCES / f"{each}.txt").is_file()]
        if not available:
            raise InventoryError(f"the licence text of {part.name} is missing: {part.licence}")
        needed += available
    return needed


def bill(parts: Iterable[Part], system: str, epoch: int, version: str) -> str:
    """Return the bill of materials as CycloneDX 1.6 JSON; the same parts always give the same text.

    A part compiled into another part is a dependency of that part; all others are dependencies of
    Studio.

    Args:
        parts: Parts of the package.
        system: System of the package.
        epoch: Timestamp of the package, in seconds since 1970.
        version: Version of Studio.
    """
    bom = Bom(serial_number=uuid.uuid5(uuid.NAMESPACE_URL, f"{PROJECT}/{version}/{system}/{epoch}"))
    bom.metadata.timestamp = datetime.fromtimestamp(epoch, timezone.utc)
    studio = bom.metadata.component = _component(Part(PROJECT, version, "MIT"), ComponentType.APPLICATION)
    dependencies = [part for part in parts if part.name != PROJECT]
    components = {_key(part): _component(part, ComponentType.LIBRARY) for part in dependencies}
    outer: Mapping[str, Component] = {
        part.name: components[_key(part)] for part in dependencies if not part.within
    }
    for component in components.values():
        bom.components.add(component)
    for part in dependencies:
        bom.register_dependency(outer[part.within] if part.within else studio, [components[_key(part)]])
    return make_outputter(bom, OutputFormat.JSON, SchemaVersion.V1_6).output_as_string(indent=1)


def _key(part: Part) -> tuple[str, str, str]:
    return part.kind, part.name, part.version


def _component(part: Part, kind: ComponentType) -> Component:
    licences = [LicenseFactory().make_from_string(part.licence)] if part.licence else []
    within, _slash, name = part.name.rpartition("/")
    type_, _slash, distributor = part.kind.partition("/")
    return Component(
        name=part.name,
        version=part.version or None,
        type=kind,
        bom_ref=f"{part.kind}/{part.name}@{part.version}",
        licenses=licences,
        purl=PackageURL(type_, distributor or within or None, name, part.version or None),
    )
