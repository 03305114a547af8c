"""NEP Studio's entry: the window."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path


def parser() -> argparse.ArgumentParser:
    """The options of ``python -m app``."""
    made = argparse.ArgumentParser(prog="nep-studio", description="NEP Studio.")
    made.add_argument("--demo", action="store_true", help="start with the virtual robot")
    made.add_argument(
        "--self-drive", metavar="DIR", type=Path, help="do the main job alone; screenshots go to DIR"
    )
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Open the window; the exit code is 0 when it was closed in order."""
    options = parser().parse_args(arguments)
    from app.ui.first_window import run  # noqa: PLC0415 (without a window nothing may load Qt)

    return run(options.self_drive)


if __name__ == "__main__":
    sys.exit(main())
