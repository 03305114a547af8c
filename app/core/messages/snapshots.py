"""Pictures of a stream that a person keeps: PNG files, as large as they were received."""

from __future__ import annotations

import os
import re
import time
from pathlib import Path

import platformdirs

from app.core.messages.picture import png_of
from app.core.storage.settings import Settings, home
from nep.i18n import _
from nep.messages.message import Message

NAME = "NEP Studio"


CHOSEN = "pictures_folder"


def folder(settings: Settings | None = None) -> Path:
    """Where snapshots go: where a person chose, else ``NEP Studio`` in the system's folder for pictures.

    With ``$NEP_STUDIO_HOME`` it is ``Pictures`` in there.
    """
    chosen = settings.get(CHOSEN, "") if settings is not None else ""
    if chosen:
        return Path(chosen)
    if os.environ.get("NEP_STUDIO_HOME"):
        return home() / "Pictures"
    return platformdirs.user_pictures_path() / NAME


def save(message: Message, into: Path | None = None) -> Path:
    """Write the message's picture as a new file, named by its topic and its time; the path of the file.

    Raises NepError when it is no picture, OSError when it can't be written. No file is ever overwritten.
    """
    data = png_of(message)
    place = into if into is not None else folder()
    place.mkdir(parents=True, exist_ok=True)
    stem = file_stem(message)
    for number in range(1, 1000):
        path = place / (f"{stem}.png" if number == 1 else f"{stem} {number}.png")
        try:
            with path.open("xb") as file:
                file.write(data)
        except FileExistsError:
            continue
        except OSError:
            path.unlink(missing_ok=True)  # half a picture is none
            raise
        return path
    raise FileExistsError(_("there are already a thousand images named “{stem}”").format(stem=stem))


def file_stem(message: Message) -> str:
    """``Pepper camera 2026-11-20 12.48.20.123``: what every system takes as a file's name."""
    stamp_ns = message.stamp_ns if message.stamp_ns is not None else time.time_ns()
    when = time.strftime("%Y-%m-%d %H.%M.%S", time.localtime(stamp_ns // 1_000_000_000))
    topic = re.sub(r"[^\w\-]+", " ", message.topic).strip()[:80] or "picture"
    return f"{topic} {when}.{stamp_ns // 1_000_000 % 1000:03}"
