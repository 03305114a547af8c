"""Write the inventory of a package: bill of materials, licence texts and notice.

`installers.freeze` runs it with the interpreter whose environment is frozen:

    python inventory/__main__.py SYSTEM EPOCH INSIDE FOLDER BILL

INSIDE is the frozen program, FOLDER gets `licences/` and `NOTICE.txt`, BILL is the bill of materials. Parts
without a known licence are errors: each is printed, and the exit code is 1.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from installers.inventory.bill import bill, write_licences  # noqa: E402 - started by its path
from installers.inventory.libraries import parts_in_folder  # noqa: E402
from installers.inventory.parts import PROJECT, InventoryError, other_parts, parts_of  # noqa: E402
from installers.inventory.wheels import parts_in_wheels  # noqa: E402


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return 0, or 1 if a part has no known licence."""
    system, epoch, program_folder, folder, bill_file = sys.argv[1:] if arguments is None else arguments
    version = metadata.version(PROJECT)
    try:
        parts = [*parts_of(), *other_parts(ROOT / "resources")]
        parts += parts_in_wheels(tuple(parts))
        parts += parts_in_folder(Path(program_folder), tuple(parts))
        write_licences(parts, Path(folder), version)
    except InventoryError as error:
        print(f"inventory: {error}", file=sys.stderr)
        return 1
    Path(bill_file).write_text(bill(parts, system, int(epoch), version), "utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
