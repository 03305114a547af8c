"""Entry point of the command `nep` in a package."""

import os

os.environ["OPENCV_VIDEOIO_PRIORITY_FFMPEG"] = (
    "0"  # packages don't contain it: installers/linux/film_libraries.py
)

from nep.system.frozen_code import hold_code

hold_code()  # before any late import

from nep.cli import main

main()
