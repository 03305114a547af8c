"""Problem report: a zip file that the user can share. Studio never uploads it.

Texts for developers are in English. The user first sees a list of the contents (`describe_contents`).
"""

from __future__ import annotations

import io
import json
import locale
import logging
import os
import platform
import sys
import threading
import time
import zipfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from app.core.faults import error_text, log_folder
from app.core.projects.file_format import DISK_FULL_ERRNOS, SUFFIX
from app.core.reports.crash_reports import CrashReports, read_reports
from app.core.reports.privacy import reportable_settings, without_home
from app.core.reports.studio_versions import format_versions
from app.core.storage.atomic_file import read_regular_file, write_atomically
from app.core.storage.settings import Settings
from app.errors import ReportError
from nep.i18n import _, format_list, language, ngettext, number
from nep.system.lazy_import import lazy_module
from nep.version import __version__

if TYPE_CHECKING:
    import psutil
else:
    psutil = lazy_module("psutil")

FILE_SUFFIX = ".zip"
README_TEXT = (
    "Problem report, created by NEP Studio {version} at the request of the user.\n\n"
    "what-happened.txt  description by the user\n"
    "versions.txt       versions of Studio, its libraries and the system\n"
    "doctor.txt         findings of the connection doctor\n"
    "settings.json      settings; most of them only by name\n"
    "log/               log files of Studio\n"
    "crashes/           crash reports\n"
    "work/              behaviours, only if the user included them\n"
)
MAX_NAME_LENGTH = 60

_log = logging.getLogger("studio.report")

InfoRows = Sequence[tuple[str, str]]


@dataclass(frozen=True)
class ReportedWork:
    """Open behaviour to include in a report.

    Attributes:
        name: Name of the behaviour.
        data: Current content in the file format.
    """

    name: str
    data: bytes


@dataclass(frozen=True)
class ReportParts:
    """Sources of a report.

    Attributes:
        info: Information that only the window has, such as the version of Qt and the screen.
        settings: Values in the file of the settings, by key.
        doctor: Returns the findings of the connection doctor; may take some seconds.
        log: Folder of the log files.
        crashes: Stored crash reports.
    """

    info: InfoRows
    settings: Mapping[str, object]
    doctor: Callable[[], str]
    log: Path = field(default_factory=log_folder)
    crashes: CrashReports = field(default_factory=CrashReports)


def file_name(now_s: float) -> str:
    """Return the default file name of a report."""
    return f"nep-studio-report-{time.strftime('%Y-%m-%d', time.localtime(now_s))}{FILE_SUFFIX}"


def describe_contents(parts: ReportParts) -> list[str]:
    """Return a list of the contents, so that the user can decide whether to share them."""
    size_kb = sum(path.stat().st_size for path in _list_logs(parts.log)) / 1000
    lines = [
        _("Versions of Studio, Python, Qt and the operating system, and the screen size"),
        _("Studio log with recent errors ({size} kB)").format(size=number(size_kb, ".1f"))
        if size_kb
        else _("Studio log (empty)"),
        _("Results of the connection doctor: NEP programs, and the addresses of this computer"),
        _("Your settings, such as language and theme"),
    ]
    crash_count = len(parts.crashes.all())
    if crash_count:
        template = ngettext("{count} crash report", "{count} crash reports", crash_count)
        lines.append(template.format(count=crash_count))
    return lines


def work_text(names: Sequence[str]) -> str:
    """Return the line about the included behaviours."""
    quoted = [_("“{name}”").format(name=name) for name in names]
    return _("Open behaviours: {names}").format(names=format_list(quoted))


def create_report(parts: ReportParts, description: str, documents: Sequence[ReportedWork] = ()) -> bytes:
    """Create the content of the zip file. Slow because of the doctor; don't call it in the main thread.

    Args:
        parts: Sources of the report.
        description: Description by the user.
        documents: Behaviours to include.
    """
    files: list[tuple[str, bytes]] = [
        ("README.txt", README_TEXT.format(version=__version__).encode()),
        ("what-happened.txt", (description.strip() or "(no description)").encode("utf-8", "replace")),
        ("versions.txt", _anonymize(_format_versions(parts))),
        ("settings.json", _anonymize(_format_settings(parts.settings))),
        ("doctor.txt", _anonymize(parts.doctor())),
    ]
    for path in _list_logs(parts.log):
        with suppress(OSError):  # rotated or unreadable; the other files are included
            files.append((f"log/{path.name}", _anonymize(read_regular_file(path).decode("utf-8", "replace"))))
    for name, data in read_reports(parts.crashes.all()):
        files.append((f"crashes/{name}", _anonymize(data.decode("utf-8", "replace"))))
    files += _encode_work(documents)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files:
            archive.writestr(name, data)
    return buffer.getvalue()


def write_report(path: Path, data: bytes) -> None:
    """Write the zip file atomically. Raises ReportError with advice for the user."""
    try:
        write_atomically(path, data)
    except (OSError, ValueError) as error:
        is_disk_full = isinstance(error, OSError) and error.errno in DISK_FULL_ERRNOS
        advice = _("free some space or choose another folder") if is_disk_full else _("choose another folder")
        reason = getattr(error, "strerror", None) or str(error)
        raise ReportError(path, reason, advice) from error


class ReportWriter:
    """Background thread that creates and writes one report."""

    def __init__(self, path: Path, create_content: Callable[[], bytes]) -> None:
        # Starts at once; `create_content` is called in the thread.
        self.path = path
        self.problem = ""
        """Why the report could not be written, as a sentence without a full stop; "" if there is no error."""
        self._create_content = create_content
        self._thread = threading.Thread(target=self._run, name="studio-report")
        self._thread.start()

    @property
    def is_done(self) -> bool:
        """True if the report was written or writing failed."""
        return not self._thread.is_alive()

    def wait(self, timeout_s: float) -> bool:
        """Wait until the report is written or writing has failed; return False on timeout (in seconds)."""
        self._thread.join(timeout_s)
        return self.is_done

    def _run(self) -> None:
        try:
            write_report(self.path, self._create_content())
        except ReportError as error:
            self.problem = str(error)
        except Exception as error:  # noqa: BLE001  shown to the user
            _log.exception("can't create a report")
            self.problem = _("can't write the report: {error}").format(error=error_text(error))


def _list_logs(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.glob("studio.log*") if path.is_file())
    except OSError:
        return []


def _anonymize(text: str) -> bytes:
    return without_home(text).encode("utf-8", "replace")


def _format_settings(values: Mapping[str, object]) -> str:
    return json.dumps(reportable_settings(values), indent=1, ensure_ascii=False, default=str)


def _encode_work(documents: Sequence[ReportedWork]) -> list[tuple[str, bytes]]:
    # Each with a unique name that is valid on every system.
    data_by_name: dict[str, bytes] = {}
    for document in documents:
        safe_name = "".join(c if c.isalnum() or c in " -_," else "_" for c in document.name)[
            :MAX_NAME_LENGTH
        ].strip()
        stem, copy_number = safe_name or "behaviour", 2
        name = f"work/{stem}{SUFFIX}"
        while name in data_by_name:
            name, copy_number = f"work/{stem} {copy_number}{SUFFIX}", copy_number + 1
        data_by_name[name] = document.data
    return list(data_by_name.items())


def _format_versions(parts: ReportParts) -> str:
    versions = ("versions used here", format_versions(Settings.studio_versions.value_in(parts.settings)))
    lines = [f"{name}: {value}" for name, value in (*_system_info(), versions, *parts.info)]
    return "\n".join([*lines, "", "packages:", *_list_packages()]) + "\n"


def _system_info() -> InfoRows:
    # Available without a window.
    memory = psutil.virtual_memory()
    names = ("XDG_SESSION_TYPE", "XDG_CURRENT_DESKTOP", "QT_QPA_PLATFORM", "NEP_MASTER", "NEP_LANG")
    return (
        ("NEP Studio", __version__),
        ("nep", __version__),
        ("Python", f"{platform.python_version()} ({platform.python_implementation()})"),
        ("built as a package", "yes" if getattr(sys, "frozen", False) else "no"),
        ("system", f"{platform.platform()} {_distribution()}".rstrip()),
        ("machine", f"{platform.machine()}, {os.cpu_count()} processors"),
        ("memory", f"{memory.total / 1e9:.1f} GB, {memory.available / 1e9:.1f} GB free"),
        ("language", f"{language()} (system: {locale.getlocale()[0]})"),
        ("encoding of file names", sys.getfilesystemencoding()),
        *((name, os.environ[name]) for name in names if name in os.environ),
    )


def _distribution() -> str:
    try:
        return f"({platform.freedesktop_os_release().get('PRETTY_NAME', '')})"
    except OSError:
        return ""


def _list_packages() -> list[str]:
    versions = {str(each.metadata["Name"]): each.version for each in metadata.distributions()}
    return sorted((f"{name} {version}" for name, version in versions.items()), key=str.lower)
