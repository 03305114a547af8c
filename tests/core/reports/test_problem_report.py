"""Tests of the problem report: contents of the zip file, excluded data, and disks that can't be written."""

from __future__ import annotations

import errno
import io
import json
import os
import zipfile
from pathlib import Path

import pytest

from app.blocks.model.project import Project
from app.core.projects.file_format import encode_file, read_file
from app.core.reports.crash import Crash
from app.core.reports.crash_reports import CrashReports
from app.core.reports.problem_report import (
    ReportedWork,
    ReportParts,
    ReportWriter,
    create_report,
    describe_contents,
    file_name,
    work_text,
    write_report,
)
from app.errors import ReportError
from tests.pseudo import untranslated

BLOCKS: dict[str, object] = {"blocks": {"blocks": [{"type": "events_started", "id": "mine"}]}}


@pytest.fixture
def parts(tmp_path: Path) -> ReportParts:
    log = tmp_path / "log"
    log.mkdir()
    (log / "studio.log").write_text(f"the newest line, of {Path.home() / 'a.py'}\n", "utf-8")
    (log / "studio.log.1").write_text("an older line\n")
    (log / "crash-of-another.trace").write_text("not a log")
    settings = {"theme": "dark", "room_keys": ["swordfish"], "recent": [{"path": "/a/Private.nepb"}]}
    return ReportParts(
        (("Qt", "6.11.3"), ("screen 1", "800 x 600")),
        settings,
        lambda: f"+ All is well in {Path.home()}.\n",
        log,
        CrashReports(log / "crashes"),
    )


def opened(data: bytes) -> dict[str, str]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert archive.testzip() is None
        return {name: archive.read(name).decode("utf-8") for name in archive.namelist()}


def test_report_contains_description_versions_settings_findings_logs_and_crash_reports(
    parts: ReportParts,
) -> None:
    parts.crashes.add(Crash("robot", "by signal 11", "where it was"))
    found = opened(create_report(parts, "  It stood still.\nThen it fell. ñ "))
    assert found["what-happened.txt"] == "It stood still.\nThen it fell. ñ"
    assert found["doctor.txt"] == "+ All is well in ~.\n"
    assert found["log/studio.log"].splitlines() == [f"the newest line, of {Path('~') / 'a.py'}"]
    assert found["log/studio.log.1"].splitlines() == ["an older line"]
    assert json.loads(found["settings.json"]) == {
        "recent": "(left out)",
        "room_keys": "(left out)",
        "theme": "dark",
    }
    (crash,) = [text for name, text in found.items() if name.startswith("crashes/")]
    assert "where it was" in crash
    for words in ("NEP Studio: ", "nep: ", "Python: ", "Qt: 6.11.3", "screen 1: 800 x 600", "system: ",
                  "built as a package: no", "\npyzmq ", "\nPySide6"):  # fmt: skip
        assert words in found["versions.txt"], words
    assert set(found) == {
        "README.txt", "what-happened.txt", "versions.txt", "settings.json", "doctor.txt", "log/studio.log",
        "log/studio.log.1", next(name for name in found if name.startswith("crashes/")),
    }  # fmt: skip


def test_report_contains_no_network_keys_recent_files_or_home_folder(parts: ReportParts) -> None:
    whole = "".join(opened(create_report(parts, "")).values())
    for words in ("swordfish", "Private", str(Path.home())):
        assert words not in whole


def test_report_includes_only_given_documents_with_unique_names(parts: ReportParts, tmp_path: Path) -> None:
    data = encode_file(Project.of_blocks("A/B: c", BLOCKS, {}))
    found = create_report(
        parts, "", [ReportedWork("A/B: c", data), ReportedWork("A_B_ c", data), ReportedWork("...", data)]
    )
    names = sorted(name for name in opened(found) if name.startswith("work/"))
    assert names == ["work/A_B_ c 2.nepb", "work/A_B_ c.nepb", "work/___.nepb"]
    with zipfile.ZipFile(io.BytesIO(found)) as archive:
        archive.extractall(tmp_path)
    assert read_file(tmp_path / "work" / "A_B_ c.nepb").always.workspace.blocks == BLOCKS


def test_report_is_created_without_a_log(tmp_path: Path) -> None:
    parts = ReportParts((), {}, lambda: "", tmp_path / "none", CrashReports(tmp_path / "none" / "crashes"))
    found = opened(create_report(parts, ""))
    assert "README.txt" in found
    assert not [name for name in found if name.startswith(("log/", "crashes/"))]
    assert "(empty)" in describe_contents(parts)[1]


def test_list_of_report_contents_includes_a_crash_report_and_is_translated(
    pseudo: None, parts: ReportParts
) -> None:
    before = describe_contents(parts)
    parts.crashes.add(Crash("studio", "how"))
    assert len(describe_contents(parts)) == len(before) + 1
    assert (
        untranslated(" ".join([*describe_contents(parts), work_text(["Mine", "Other"])]), "Mine", "Other")
        == []
    )


def test_report_file_name_has_the_date() -> None:
    assert file_name(1_700_000_000.0) in {
        "nep-studio-report-2023-11-14.zip",
        "nep-studio-report-2023-11-15.zip",
    }


def test_written_report_is_complete_and_leaves_no_temporary_file(parts: ReportParts, tmp_path: Path) -> None:
    writer = ReportWriter(tmp_path / "report.zip", lambda: create_report(parts, "words"))
    assert writer.wait(60)
    assert writer.problem == ""
    assert opened((tmp_path / "report.zip").read_bytes())["what-happened.txt"] == "words"
    assert not list(tmp_path.glob(".*"))


@pytest.mark.skipif(os.name != "posix", reason="a device that is always full")
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_unwritable_report_folder_raises_and_leaves_no_file(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(ReportError) as raised:
        write_report(tmp_path / "file" / "report.zip", b"zip")
    assert str(raised.value).startswith("can't write report.zip (")
    assert str(raised.value).endswith("; choose another folder")
    writer = ReportWriter(tmp_path / "file" / "report.zip", lambda: b"zip")
    assert writer.wait(60)
    assert writer.problem == str(raised.value)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_full_disk_error_has_its_own_advice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_path: Path, _data: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("app.core.reports.problem_report.write_atomically", full)
    with pytest.raises(ReportError, match="free some space or choose another folder"):
        write_report(tmp_path / "report.zip", b"zip")


def test_error_during_report_creation_is_reported(tmp_path: Path) -> None:
    def fails() -> bytes:
        raise KeyError("Name")

    writer = ReportWriter(tmp_path / "report.zip", fails)
    assert writer.wait(60)
    assert writer.problem == "can't write the report: KeyError: 'Name'"
    assert not list(tmp_path.iterdir())
