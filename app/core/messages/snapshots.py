"""Snapshots of images, saved as PNG files in full resolution."""

from __future__ import annotations

import re
import time
from pathlib import Path

from app.core.messages.picture import encode_png
from app.core.storage.folders import default_pictures_folder
from nep.i18n import _
from nep.messages.message import Message


def save(message: Message, target_folder: Path | None = None) -> Path:
    """Save the image of a message to a new file, named by topic and time; return its path.

    Never overwrites a file. Raises NepError if the message is not an image or can't be stored as PNG,
    OSError if the file can't be written or 999 files with this name exist.

    Args:
        message: Message with an image.
        target_folder: Folder; default: `default_pictures_folder`.
    """
    data = encode_png(message)
    folder_path = target_folder if target_folder is not None else default_pictures_folder()
    folder_path.mkdir(parents=True, exist_ok=True)
    stem = file_stem(message)
    for number in range(1, 1000):
        path = folder_path / (f"{stem}.png" if number == 1 else f"{stem} {number}.png")
        try:
            with path.open("xb") as file:
                file.write(data)
        except FileExistsError:
            continue
        except OSError:
            path.unlink(missing_ok=True)  # delete an incomplete file
            raise
        return path
    raise FileExistsError(
        _("the folder already has 999 images named “{stem}”; move or delete some").format(stem=stem)
    )


def file_stem(message: Message) -> str:
    """Return a file name without extension, such as ``Pepper camera 2026-11-20 12.48.20.123``.

    The name is valid on every operating system.
    """
    stamp_ns = message.stamp_ns if message.stamp_ns is not None else time.time_ns()
    time_text = time.strftime("%Y-%m-%d %H.%M.%S", time.localtime(stamp_ns // 1_000_000_000))
    topic = re.sub(r"[^\w\-]+", " ", message.topic).strip()[:80] or "picture"
    return f"{topic} {time_text}.{stamp_ns // 1_000_000 % 1000:03}"
