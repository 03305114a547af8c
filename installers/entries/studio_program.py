"""Entry point of `nep-studio` in a package, also used by its child processes."""

import os

os.environ["OPENCV_VIDEOIO_PRIORITY_FFMPEG"] = (
    "0"  # packages don't contain FFmpeg: installers/linux/film_libraries.py
)

import sys

from nep.system.frozen_code import keep_archive_open

keep_archive_open()  # before any late import

from app.__main__ import main

sys.exit(main())
