"""Entry point of the command `nep` in a package."""

import os

os.environ["OPENCV_VIDEOIO_PRIORITY_FFMPEG"] = (
    "0"  # packages don't contain FFmpeg: installers/linux/film_libraries.py
)

from nep.system.frozen_code import keep_archive_open

keep_archive_open()  # before any late import

from nep.cli import main

main()
