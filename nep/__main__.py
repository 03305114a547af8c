"""Entry point of `python -m nep`, the same as the `nep` command."""

from __future__ import annotations

from nep.cli import main

if __name__ == "__main__":
    main()
