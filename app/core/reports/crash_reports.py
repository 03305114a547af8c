"""Stored crash reports: one text file for each crash, at most ten.

Each report is offered once, at the next start.
"""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from app.core.alerts.alerts import Alerts
from app.core.faults import CONSOLE_EXTRA, RepeatFilter, log_folder
from app.core.reports.crash import PARTS, Crash, Part
from app.core.reports.privacy import without_home
from app.core.reports.studio_versions import VERSION_PATTERN
from app.core.storage.atomic_file import MAX_BYTES, read_regular_file, write_atomically
from app.intents import ReportProblem
from nep.i18n import _, lazy
from nep.system.replace_file import replace_file
from nep.version import __version__

MAX_REPORTS = 10
MAX_REPORT_CHARS = 100_000
ALERT_ID = "crash"
_STAMP_FORMAT = "%Y-%m-%d %H.%M.%S"
_NAME_PATTERN = re.compile(
    rf"crash (?P<stamp>\d{{4}}-\d\d-\d\d \d\d\.\d\d\.\d\d) (?P<part>{'|'.join(PARTS)})(?: \d+)?"
    r"(?P<new>\.new)?\.txt"
)
ALERT_TITLES: dict[Part, str] = {
    "studio": lazy("Studio closed unexpectedly last time."),
    "behaviour": lazy("A behaviour's program crashed last time."),
    "robot": lazy("A virtual robot crashed last time."),
    "master": lazy("The master crashed last time."),
    "editor": lazy("The block editor crashed last time."),
}
HEADING = "Crash report of NEP Studio "
OTHER_VERSION_MESSAGE = lazy("The crash happened in NEP Studio {version}; this is {own}.")
ALERT_DETAIL = lazy("A report helps us fix the problem. Nothing is sent automatically.")

_log = logging.getLogger("studio.crashes")


@dataclass(frozen=True, slots=True)
class CrashReport:
    """Stored crash report.

    Attributes:
        path: File of the report.
        part: Part of Studio that crashed.
        detected_s: Time when the crash was detected, in seconds since 1970.
        is_new: True until the report has been offered to the user.
    """

    path: Path
    part: Part
    detected_s: float
    is_new: bool


class CrashReports:
    """Crash reports in a folder that all instances share. No method raises OSError."""

    def __init__(self, folder: Path | None = None, clock: Callable[[], float] = time.time) -> None:
        # `folder` defaults to `crashes` beside the log files; `clock` is epoch seconds.
        self._folder = folder if folder is not None else log_folder() / "crashes"
        self._clock = clock

    def add(self, crash: Crash) -> Path | None:
        """Store a report and delete the oldest reports beyond the limit.

        Returns:
            File of the report, or None if it can't be written.
        """
        now = self._clock()
        try:
            path = self._unused_path(
                f"crash {time.strftime(_STAMP_FORMAT, time.localtime(now))} {crash.part}"
            )
            write_atomically(
                path, _format_report(crash, now).encode("utf-8", "replace"), durable=False, private=True
            )
        except OSError as error:
            _log.warning("a crash report can't be saved: %s", error, extra=CONSOLE_EXTRA)
            return None
        for old in self.all()[MAX_REPORTS:]:
            with suppress(OSError):  # another instance has done this already
                old.path.unlink(missing_ok=True)
        return path

    def _unused_path(self, stem: str) -> Path:
        # An unused name, considering both offered and new reports.
        used_names = {each.path.name.replace(".new.txt", ".txt") for each in self.all()}
        names = (stem, *(f"{stem} {number}" for number in range(2, len(used_names) + 3)))
        return self._folder / f"{next(name for name in names if f'{name}.txt' not in used_names)}.new.txt"

    def all(self) -> list[CrashReport]:
        """Return the stored reports, newest first."""
        try:
            parsed = [_parse_report(path) for path in self._folder.glob("crash *.txt")]
        except OSError:
            return []
        valid = [each for each in parsed if each is not None]
        return sorted(valid, key=lambda each: (each.detected_s, each.path.name), reverse=True)

    def take_new(self) -> list[CrashReport]:
        """Return the new reports, newest first, and save that they have been offered.

        A report for which that can't be saved is omitted; otherwise it would be offered at every start.
        """
        new_reports = []
        for report in self.all():
            if report.is_new:
                path = report.path.with_name(report.path.name.replace(".new.txt", ".txt"))
                with suppress(OSError):  # another instance took it, or the disk is read-only
                    replace_file(report.path, path)
                    new_reports.append(CrashReport(path, report.part, report.detected_s, is_new=False))
        return new_reports


class CrashLog(logging.Handler):
    """Logging handler that stores a report for each crash. Repeated crashes are stored less often."""

    def __init__(self, reports: CrashReports) -> None:
        super().__init__(logging.WARNING)
        self._reports, self._repeat_filter = reports, RepeatFilter()

    def emit(self, record: logging.LogRecord) -> None:
        """Store a report if the record describes a crash (`app.core.reports.crash.crash_extra`)."""
        crash = getattr(record, "crash", None)
        if isinstance(crash, Crash) and self._repeat_filter.filter(record) is not None:
            self._reports.add(crash)


def show_crash_alert(alerts: Alerts, reports: CrashReports) -> None:
    """Raise an alert about crashes before this start, with a button that creates a problem report."""
    new_reports = reports.take_new()
    if new_reports:
        worst = min(new_reports, key=lambda each: PARTS.index(each.part))
        version = _read_version(worst)
        sentences = [_(ALERT_DETAIL)]
        if version not in {"", __version__}:  # it may be fixed already
            sentences.insert(0, _(OTHER_VERSION_MESSAGE).format(version=version, own=__version__))
        alerts.raise_alert(
            ALERT_ID,
            "warn",
            _(ALERT_TITLES[worst.part]),
            " ".join(sentences),
            button=_("Report a problem"),
            intent=ReportProblem(),
        )


def read_reports(reports: Sequence[CrashReport]) -> list[tuple[str, bytes]]:
    """Return the file names and contents of reports; unreadable reports are skipped."""
    contents = []
    for report in reports:
        with suppress(OSError):
            contents.append(
                (report.path.name.replace(".new.txt", ".txt"), read_regular_file(report.path, MAX_BYTES))
            )
    return contents


def _read_version(report: CrashReport) -> str:
    # From the report's first line; "" if it has none.
    try:
        first_line = read_regular_file(report.path, MAX_BYTES).partition(b"\n")[0].decode("utf-8", "replace")
    except OSError:
        return ""
    version = first_line.removeprefix(HEADING).strip()
    return version if first_line.startswith(HEADING) and VERSION_PATTERN.fullmatch(version) else ""


def _format_report(crash: Crash, now_s: float) -> str:
    # For developers, therefore in English.
    detected_time = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(now_s))
    detector = "" if crash.version == __version__ else f" by NEP Studio {__version__}"
    lines = (
        f"{HEADING}{crash.version or '(version not known)'}",
        "",
        f"part: {crash.part}",
        f"how: {crash.cause}",
        f"noticed: {detected_time}{detector}",
        "",
        crash.text[-MAX_REPORT_CHARS:],
    )
    return without_home("\n".join(lines).rstrip() + "\n")


def _parse_report(path: Path) -> CrashReport | None:
    match = _NAME_PATTERN.fullmatch(path.name)
    part = next((part for part in PARTS if match is not None and match["part"] == part), None)
    if match is None or part is None:
        return None
    try:
        detected_s = time.mktime(time.strptime(match["stamp"], _STAMP_FORMAT))
    except (ValueError, OverflowError):
        return None
    return CrashReport(path, part, detected_s, match["new"] is not None)
