"""The command `nep` of a package."""

from nep.cli import main

main()
