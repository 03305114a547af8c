"""Tests of reports on a full and on a read-only disk: no partial files, and Studio continues."""

from __future__ import annotations

import pytest

from tests.small_disk import SmallDisk

FULL = """
import json, sys
from pathlib import Path
from app.core.reports.crash import Crash
from app.core.reports.crash_reports import CrashReports
from app.core.reports.problem_report import ReportParts, create_report, write_report
from app.core.reports.studio_run import StudioRun
from app.errors import AppError

disk = Path(sys.argv[1])
reports = CrashReports(disk / "crashes")
reports.add(Crash("robot", "before it was full"))
parts = ReportParts((), {}, lambda: "", disk / "log", reports)
data = create_report(parts, "x" * 10)
old = disk / "report.zip"
write_report(old, data)
with (disk / "filler").open("wb", buffering=0) as file:
    try:
        while True:
            file.write(b"x" * 4096)
    except OSError as error:
        full = error.strerror
told = {"full": full}
try:
    write_report(disk / "other.zip", data)
except AppError as error:
    told["report"] = str(error)
try:
    write_report(old, data + bytes(50_000))
except AppError as error:
    told["over"] = str(error)
told["old"] = old.read_bytes() == data
told["crash"] = str(reports.add(Crash("studio", "x" * 9000)))
run = StudioRun(disk / "runs", disk / "log")
run.start()
told["noted"] = run.is_recorded
told["left"] = [str(each) for each in run.pop_crashes()]
told["offered"] = [each.part for each in reports.take_new()]
run.finish()
told["files"] = sorted(each.name for each in disk.rglob("*") if each.is_file())
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def disk(tmp_path_factory: pytest.TempPathFactory) -> SmallDisk:
    return SmallDisk(tmp_path_factory.mktemp("disk"))


def test_report_on_full_disk_is_complete_or_absent(disk: SmallDisk) -> None:
    told = disk.run(FULL)
    advice = "free some space or choose another folder"
    assert told["report"] == f"can't write other.zip ({told['full']}); {advice}"
    assert told["over"] == f"can't write report.zip ({told['full']}); {advice}"
    assert told["old"] is True, "what was there is as it was"
    assert told["crash"] == "None"
    assert told["noted"] is False
    assert told["left"] == []
    assert told["offered"] == ["robot"], "what was kept before is told"
    files = told["files"]
    assert isinstance(files, list)
    assert sorted(name for name in files if not name.startswith("crash ")) == ["filler", "report.zip"]


READ_ONLY = """
import json, logging, sys
from pathlib import Path
from app.core.reports.crash import Crash
from app.core.reports.crash_reports import CrashReports
from app.core.reports.studio_run import StudioRun

lines = []
class Lines(logging.Handler):
    def emit(self, record):
        lines.append(record.getMessage())
logging.getLogger().addHandler(Lines())
disk = Path(sys.argv[1])
with StudioRun(disk / "runs", disk / "log") as run:
    noted, left = run.is_recorded, run.pop_crashes()
reports = CrashReports(disk / "log" / "crashes")
print(json.dumps({"noted": noted, "left": len(left), "lines": len(lines), "new": len(reports.take_new()),
                  "all": len(reports.all())}))
"""
BEFORE = (
    "mkdir -p '{0}/log/crashes' '{0}/runs'"
    " && echo x > '{0}/log/crashes/crash 2026-01-01 10.00.00 studio.new.txt'"
    " && echo '{{\"pid\": 4000000, \"began_s\": 4e9}}' > '{0}/runs/a.json'"
    " && mount -o remount,ro '{0}'"
)


def test_read_only_disk_is_logged_once_and_not_reported_as_crash(disk: SmallDisk) -> None:
    told = disk.run(READ_ONLY, BEFORE.format(disk.folder))
    # The run mark and the old report can't be deleted; neither is reported at each start.
    assert told == {"noted": False, "left": 0, "lines": 1, "new": 0, "all": 1}
