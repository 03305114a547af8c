"""`python3 dev.py package`: build packages of NEP Studio and of the client libraries into `dist/`.

    python3 dev.py package                      packages of this system and client libraries
    python3 dev.py package -- --system clients  only nep for JavaScript, C# (NuGet) and Unity
    python3 dev.py package -- --system windows  Windows packages; on Linux with Wine
    python3 dev.py package -- --keep-frozen     reuse the frozen program of an earlier build

Also writes a bill of materials (CycloneDX) for each system, and the SHA-256 checksums.
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
    """Interface of the `packer` module of each system."""

    def build(self, context: Context, *, keep_frozen: bool) -> Sequence[Path]:
        """Build the packages of the system and return their paths.

        Args:
            context: System, version and folders.
            keep_frozen: True to reuse the frozen program of an earlier build.

        Raises:
            PackageError: A step has failed.
        """


def packer_for(system: str) -> Packer:
    """Return the packer of a system: one of `SYSTEMS`, or "clients" for the client libraries."""
    return cast("Packer", importlib.import_module(f"installers.{system}.packer"))


def write_sums(folder: Path) -> Path:
    """Write the SHA-256 checksums of a folder's packages to a file and return its path.

    The file has the format of `sha256sum --check`.
    """
    lines = [
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n"
        for path in sorted(folder.iterdir())
        if path.is_file() and path.name != SUMS
    ]
    sums = folder / SUMS
    sums.write_text("".join(lines), "utf-8", newline="\n")
    return sums


def format_sizes(paths: Iterable[Path]) -> str:
    """Return the names and sizes of files, one per line."""
    return "\n".join(f"  {path.name}  {path.stat().st_size / 1e6:.1f} MB" for path in paths)


def main(arguments: Sequence[str] | None = None) -> int:
    """Build the packages; return 0, or 2 if a package can't be built."""
    parser = argparse.ArgumentParser(
        prog="dev.py package", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--system", choices=[*SYSTEMS, CLIENTS])
    parser.add_argument(
        "--keep-frozen", action="store_true", help=f"reuse the frozen '{APP}' of an earlier build"
    )
    options = parser.parse_args(arguments)
    contexts = [
        Context(system) for system in ([options.system] if options.system else [CLIENTS, this_system()])
    ]
    dist = contexts[0].dist
    dist.mkdir(exist_ok=True)
    start_s = time.monotonic()
    paths: list[Path] = []
    try:
        for context in contexts:
            paths += packer_for(context.system).build(context, keep_frozen=options.keep_frozen)
    except PackageError as error:
        print(f"package: {error}", file=sys.stderr)
        return 2
    sums = write_sums(dist)
    print(
        f"· built in {time.monotonic() - start_s:.0f} s, in {dist.name}/:\n{format_sizes([*paths, sums])}",
        flush=True,
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
