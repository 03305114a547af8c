"""Video files of a recording's images, in a container that OpenCV can write on this computer.

MP4 requires FFmpeg, which Studio's packages don't include. OpenCV itself can write Motion JPEG in .avi files,
which VLC and the players of Windows and Linux support.
"""

from __future__ import annotations

import tempfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nep.errors import DecodeError, RecordingError
from nep.i18n import _
from nep.messages.message import Message
from nep.system.replace_file import replace_file

MAX_DURATION_S = 86_400.0
"""Maximum duration in seconds, because an image from another day would cause millions of frames."""
_TEST_FRAME_SIZE_PX = (64, 48)


@dataclass(frozen=True)
class Container:
    """Video container, and the OpenCV back end that writes and reads it.

    Attributes:
        suffix: File suffix, such as ".mp4".
        fourcc: Four-character code of the codec.
        api: Name of the OpenCV back end.
    """

    suffix: str
    fourcc: str
    api: str

    def new_writer(self, opencv: Any, path: Path, fps: float, size: tuple[int, int]) -> Any:  # noqa: ANN401
        """Create an OpenCV `VideoWriter`, which may have failed to open (see its `isOpened`).

        Args:
            opencv: The module cv2.
            path: File to write.
            fps: Frame rate in Hz.
            size: Width and height in px.
        """
        code = opencv.VideoWriter_fourcc(*self.fourcc)
        return opencv.VideoWriter(str(path), getattr(opencv, self.api), code, fps, size)


CONTAINERS = (Container(".mp4", "mp4v", "CAP_ANY"), Container(".avi", "MJPG", "CAP_OPENCV_MJPEG"))
"""Containers in order of preference."""


def available_container(opencv: Any, folder: Path) -> Container:  # noqa: ANN401 - a module
    """Return the first container that OpenCV can write, determined by writing a test file.

    Args:
        opencv: The module cv2.
        folder: Writable folder, in which a temporary folder is created.

    Raises:
        RecordingError: OpenCV can't write any container.
        OSError: The folder is not writable.
    """
    with tempfile.TemporaryDirectory(prefix=".film-", dir=folder) as test_folder:
        for container in CONTAINERS:
            writer = container.new_writer(
                opencv, Path(test_folder) / f"trial{container.suffix}", 30.0, _TEST_FRAME_SIZE_PX
            )
            is_open = writer.isOpened()
            writer.release()
            if is_open:
                return container
    raise RecordingError(str(folder), _("OpenCV can't write videos on this computer"))


def decode_frame(opencv: Any, message: Message) -> Any:  # noqa: ANN401 - an array
    """Convert the image of a message to a BGR array with 8 bits per channel.

    Returns None if the image can't be decoded.
    """
    try:
        frame: Any = message.payload
    except DecodeError:
        return None
    if frame.dtype.name != "uint8":
        frame = opencv.normalize(frame, None, 0, 255, opencv.NORM_MINMAX).astype("uint8")
    channels = 1 if frame.ndim == 2 else frame.shape[2]
    if channels in {1, 2}:
        plane = frame if frame.ndim == 2 else frame[:, :, 0]
        return opencv.cvtColor(plane.copy(), opencv.COLOR_GRAY2BGR)
    return frame[:, :, :3].copy()


class VideoFile:
    """Video file with a constant frame rate. The first image determines the frame size.

    Args:
        opencv: The module cv2.
        path: File to write.
        fps: Frame rate in Hz.
        container: Container of the video.
    """

    def __init__(
        self,
        opencv: Any,  # noqa: ANN401 - a module
        path: Path,
        fps: float,
        container: Container,
    ) -> None:
        self._opencv, self._path, self._fps = opencv, path, fps
        self._container = container
        self._writer: Any = None
        self._size = (0, 0)
        self._start_ns = self._frame_count = 0
        self._last_frame: Any = None
        # OpenCV determines the container from the suffix
        self._video_path = path.with_name(f"{path.name}{container.suffix}")

    def add(self, log_ns: int, frame: Any) -> None:  # noqa: ANN401 - an array
        """Add an image, and repeat the previous one until that time.

        Args:
            log_ns: Time of the image in ns since 1970.
            frame: BGR array with 8 bits per channel.

        Raises:
            RecordingError: The video can't be written or is too long.
        """
        if self._writer is None:
            height, width = frame.shape[:2]
            self._size = (width // 2 * 2 or 2, height // 2 * 2 or 2)
            self._writer = self._container.new_writer(self._opencv, self._video_path, self._fps, self._size)
            if not self._writer.isOpened():
                raise RecordingError(str(self._path), _("OpenCV can't write videos on this computer"))
            self._start_ns = log_ns
        if log_ns - self._start_ns > MAX_DURATION_S * 1e9:
            raise RecordingError(str(self._path), _("the images span more than a day; choose a shorter part"))
        frame_index = int((log_ns - self._start_ns) * self._fps / 1e9)
        while self._last_frame is not None and self._frame_count < frame_index:
            self._writer.write(self._last_frame)
            self._frame_count += 1
        if (frame.shape[1], frame.shape[0]) != self._size:
            frame = self._opencv.resize(frame, self._size)
        self._last_frame = frame

    def finish(self) -> None:
        """Write the last frame and complete the file; do nothing if no image was added.

        Raises `RecordingError` if frames are missing: OpenCV does not report a full disk, so the frames
        in the file are counted.
        """
        if self._writer is None:
            return
        self._writer.write(self._last_frame)
        self._frame_count += 1
        self.close()
        capture = self._opencv.VideoCapture(str(self._video_path), getattr(self._opencv, self._container.api))
        count = int(capture.get(self._opencv.CAP_PROP_FRAME_COUNT))
        capture.release()
        if count != self._frame_count:
            raise RecordingError(str(self._path), _("the video can't be written; the disk may be full"))
        replace_file(self._video_path, self._path)

    def close(self) -> None:
        """Close the file without completing the video. Idempotent."""
        if self._writer is not None:
            self._writer.release()

    def remove(self) -> None:
        """Close and delete the incomplete file."""
        self.close()
        with suppress(OSError):
            self._video_path.unlink(missing_ok=True)
