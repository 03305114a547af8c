"""The command `nep` of a package."""

import os

os.environ["OPENCV_VIDEOIO_PRIORITY_FFMPEG"] = (
    "0"  # packages come without it: installers/linux/film_libraries.py
)

from nep.system.frozen_code import hold_code

hold_code()  # before anything is imported late

from nep.cli import main

main()
