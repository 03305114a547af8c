"""Entry point of `python -m nep`, which is the `nep` command."""

from __future__ import annotations

from nep.cli import main

if __name__ == "__main__":
    main()
