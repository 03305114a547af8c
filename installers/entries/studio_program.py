"""The program `nep-studio` of a package; a frozen Studio is its own child processes, too."""

import sys

from app.__main__ import main

sys.exit(main())
