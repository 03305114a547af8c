"""`python3 dev.py package`: packages of NEP Studio and of the client libraries, written to `dist/`.

    python3 dev.py package                       the packages of this system and the client libraries
    python3 dev.py package -- --system clients   only nep for JavaScript, C# (NuGet) and Unity
    python3 dev.py package -- --system windows   the Windows packages; on Linux through Wine
    python3 dev.py package -- --keep-frozen      pack once more what is frozen already

Beside the packages are a bill of materials (CycloneDX) for each system and the SHA-256 sums of all.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Protocol, cast

from installers.context import APP, SYSTEMS, Context, PackageError, this_system

SUMS = "SHA256SUMS"
CLIENTS = "clients"


class Packer(Protocol):
    """What each system's `packer` module is."""

    def build(self, context: Context, *, keep_frozen: bool) -> Sequence[Path]:
        """Freeze, unless what is frozen is to be kept, and pack; the packages. Raises `PackageError`."""


def packer_for(system: str) -> Packer:
    """Return the packer of one of `SYSTEMS` or of the client libraries."""
    return cast("Packer", importlib.import_module(f"installers.{system}.packer"))


def write_sums(folder: Path) -> Path:
    """The file with the SHA-256 sum of each package in a folder, as `sha256sum --check` reads it."""
    lines = [
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n"
        for path in sorted(folder.iterdir())
        if path.is_file() and path.name != SUMS
    ]
    sums = folder / SUMS
    sums.write_text("".join(lines), "utf-8", newline="\n")
    return sums


def told(made: Iterable[Path]) -> str:
    """The files with their sizes, one a line."""
    return "\n".join(f"  {path.name}  {path.stat().st_size / 1e6:.1f} MB" for path in made)


def main(arguments: Sequence[str] | None = None) -> int:
    """Build; 0 when all is there, 2 when this computer can't."""
    parser = argparse.ArgumentParser(
        prog="dev.py package", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--system", choices=[*SYSTEMS, CLIENTS])
    parser.add_argument("--keep-frozen", action="store_true", help=f"take the '{APP}' that is frozen already")
    options = parser.parse_args(arguments)
    contexts = [
        Context(system) for system in ([options.system] if options.system else [CLIENTS, this_system()])
    ]
    dist = contexts[0].dist
    dist.mkdir(exist_ok=True)
    begun = time.monotonic()
    made: list[Path] = []
    try:
        for context in contexts:
            made += packer_for(context.system).build(context, keep_frozen=options.keep_frozen)
    except PackageError as error:
        print(f"package: {error}", file=sys.stderr)
        return 2
    sums = write_sums(dist)
    print(
        f"· in {dist.name}/, after {time.monotonic() - begun:.0f} s:\n{told([*made, sums])}",
        flush=True,
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
