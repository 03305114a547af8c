"""The program `nep-studio` of a package; a frozen Studio is also its own child processes."""

import os

os.environ["OPENCV_VIDEOIO_PRIORITY_FFMPEG"] = (
    "0"  # packages come without it: installers/linux/film_libraries.py
)

import sys

from nep.system.frozen_code import hold_code

hold_code()  # before anything is imported late

from app.__main__ import main

sys.exit(main())
