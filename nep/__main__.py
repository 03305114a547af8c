"""`python -m nep`: the same as the command `nep`."""

from __future__ import annotations

from nep.cli import main

if __name__ == "__main__":
    main()
