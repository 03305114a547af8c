"""Selection of the topics to record, by name or pattern, and its storage in the settings."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from nep.errors import BadTopicError
from nep.i18n import _, lazy
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.recordings import recorder
else:
    recorder = lazy_module("nep.recordings.recorder")  # loaded lazily, so that no start waits for it

MODES = ("all", "chosen", "pattern")
MIN_S, MAX_S, DEFAULT_S = 5, 3_600, 60
MIN_GB, MAX_GB, DEFAULT_GB = 0.1, 1_000.0, 2.0
MIN_MINUTES, MAX_MINUTES = 0.1, 10_080.0
"""Minimum and maximum duration of a recording in minutes."""
MAX_NAMES = 1_000
MAX_NAME_LENGTH = 80
"""Maximum length of a file name without extension, supported by all file systems."""
EXCLUDE_KEYWORD = lazy("not")
_INVALID_CHARACTERS = re.compile(r'[\x00-\x1f\x7f<>:"/\\|?*\ud800-\udfff]+')
_RESERVED_NAMES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class RecordingChoice:
    """Selection of the topics to record, and limits of the recording.

    Attributes:
        mode: "all"; "chosen" for the topics in `topics`; or "pattern" for the topics that match a
            pattern in `patterns` (empty: all topics) and no pattern in `excluded`.
        max_minutes: Maximum duration in minutes; None for no limit.
        max_gb: Maximum size in GB (10^9 bytes); None for no limit.
    """

    mode: str = "all"
    topics: tuple[str, ...] = ()
    patterns: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()
    max_minutes: float | None = None
    max_gb: float | None = None

    def expected_end(
        self, elapsed_s: float, size_bytes: float, bytes_per_s: float | None
    ) -> tuple[float, float] | None:
        """Return the expected duration (s) and size (bytes) of the finished recording.

        Returns None if the recording has no limit, or if `bytes_per_s` is unknown.

        Args:
            elapsed_s: Current duration in seconds.
            size_bytes: Current size in bytes.
            bytes_per_s: Current data rate in bytes per second, or None.
        """
        limits_s = [] if self.max_minutes is None else [60.0 * self.max_minutes]
        if self.max_gb is not None and bytes_per_s:
            limits_s.append(elapsed_s + (1e9 * self.max_gb - size_bytes) / bytes_per_s)
        if bytes_per_s is None or not limits_s:
            return None
        end_s = max(elapsed_s, min(limits_s))
        return end_s, size_bytes + bytes_per_s * (end_s - elapsed_s)

    @property
    def selection(self) -> recorder.TopicSelection:
        """Selection as expected by the recorder. Raises `BadTopicError` for an invalid topic or pattern."""
        if self.mode == "chosen":
            return recorder.TopicSelection(self.topics)
        if self.mode == "pattern":
            return recorder.TopicSelection(self.patterns, self.excluded)
        return recorder.TopicSelection()

    @property
    def problem(self) -> str:
        """Reason why the selection is invalid, or ""."""
        if self.mode == "chosen" and not self.topics:
            return _("No topic is selected.")
        try:
            self.selection  # noqa: B018  raises for invalid patterns
        except BadTopicError as error:
            return f"{str(error)[:1].upper()}{str(error)[1:]}."
        return ""


def parse_choice(data: object) -> RecordingChoice:
    """Parse a selection stored in the settings; invalid parts become defaults."""
    if not isinstance(data, Mapping):
        return RecordingChoice()
    mode = data.get("mode")
    return RecordingChoice(
        mode if isinstance(mode, str) and mode in MODES else "all",
        _parse_names(data.get("topics")),
        _parse_names(data.get("patterns")),
        _parse_names(data.get("left_out")),
        _number(data.get("ends_min"), MIN_MINUTES, MAX_MINUTES),
        _number(data.get("ends_gb"), MIN_GB, MAX_GB),
    )


def choice_to_json(choice: RecordingChoice) -> dict[str, object]:
    """Return a selection as JSON data for the settings."""
    return {
        "mode": choice.mode,
        "topics": list(choice.topics),
        "patterns": list(choice.patterns),
        "left_out": list(choice.excluded),
        "ends_min": choice.max_minutes,
        "ends_gb": choice.max_gb,
    }


def _parse_names(names: object) -> tuple[str, ...]:
    return (
        tuple(each for each in names if isinstance(each, str))[:MAX_NAMES] if isinstance(names, list) else ()
    )


@dataclass(frozen=True, slots=True)
class RingSettings:
    """Settings of the flight recorder.

    Attributes:
        is_on: True if the flight recorder is on.
        seconds: Duration of the buffer in seconds.
        size_gb: Maximum size of the buffer in GB (10^9 bytes).
        patterns: Patterns of the recorded topics; empty for all topics.
        excluded: Patterns of topics that are not recorded.
    """

    is_on: bool = False
    seconds: int = DEFAULT_S
    size_gb: float = DEFAULT_GB
    patterns: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()

    @property
    def problem(self) -> str:
        """Reason why the selection of topics is invalid, or ""."""
        return RecordingChoice("pattern", (), self.patterns, self.excluded).problem


def parse_ring_settings(data: object) -> RingSettings:
    """Parse the settings of the flight recorder; invalid parts become defaults."""
    if not isinstance(data, Mapping):
        return RingSettings()
    seconds, size_gb = data.get("seconds"), data.get("size_gb")
    return RingSettings(
        data.get("is_on") is True,
        int(seconds) if _is_within(seconds, MIN_S, MAX_S) else DEFAULT_S,  # type: ignore[arg-type]
        float(size_gb) if _is_within(size_gb, MIN_GB, MAX_GB) else DEFAULT_GB,  # type: ignore[arg-type]
        _parse_names(data.get("patterns")),
        _parse_names(data.get("left_out")),
    )


def ring_settings_to_json(settings: RingSettings) -> dict[str, object]:
    """Return the settings of the flight recorder as JSON data."""
    return {
        "is_on": settings.is_on,
        "seconds": settings.seconds,
        "size_gb": settings.size_gb,
        "patterns": list(settings.patterns),
        "left_out": list(settings.excluded),
    }


def _number(value: object, minimum: float, maximum: float) -> float | None:
    return float(value) if _is_within(value, minimum, maximum) else None  # type: ignore[arg-type]


def _is_within(value: object, minimum: float, maximum: float) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and minimum <= value <= maximum  # type: ignore[operator]


def parse_patterns(text: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Parse patterns such as "/arm/* *action* not /arm/raw", separated by spaces or commas.

    The word "not", or its translation, excludes the topics of the pattern directly after it.

    Returns:
        Patterns of topics to record, and patterns of topics to exclude.
    """
    included: list[str] = []
    excluded: list[str] = []
    is_exclusion = False
    for token in text.replace(",", " ").split():
        if token.casefold() in {EXCLUDE_KEYWORD, _(EXCLUDE_KEYWORD).casefold()}:
            is_exclusion = True
            continue
        target = excluded if is_exclusion else included
        if token not in target:
            target.append(token)
        is_exclusion = False
    return tuple(included), tuple(excluded)


def file_stem(name: str) -> str:
    """Return ``name`` as a file name that is valid on every operating system.

    Returns "" if no valid character remains.
    """
    stem = _INVALID_CHARACTERS.sub(" ", name)
    stem = " ".join(stem.split())[:MAX_NAME_LENGTH].strip(" .")
    return f"_{stem}" if _RESERVED_NAMES.fullmatch(stem) else stem


def free_path(preferred: Path, *, is_folder: bool = False) -> Path:
    """Return an unused path: ``preferred``, or the same path with a number appended to the name.

    Args:
        preferred: Preferred path.
        is_folder: True for a folder; a dot in the name then does not start an extension.
    """
    stem, suffix = (preferred.name, "") if is_folder else (preferred.stem, preferred.suffix)
    path, number = preferred, 2
    while path.exists():
        path, number = preferred.with_name(f"{stem} {number}{suffix}"), number + 1
    return path
