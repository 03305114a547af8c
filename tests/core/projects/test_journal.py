"""Tests of the journal: unsaved work of a killed Studio is offered, that of a running one is not."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from app.blocks.model.project import Project
from app.core.projects.journal import Journal, unsaved_work

WORKSPACE: dict[str, object] = {"blocks": {"blocks": [{"type": "events_started", "id": "é\ud800"}]}}
GREETING = Project.of_blocks("Greeting", WORKSPACE)


def _killed_writer(folder: Path) -> None:
    code = (
        "import os, sys, pathlib\n"
        "from app.blocks.model.project import Project\n"
        "from app.core.projects.journal import Journal\n"
        "j = Journal(pathlib.Path(sys.argv[1]), clock=lambda: 123.0)\n"
        "project = Project.of_blocks('Greeting', {'blocks': 1}, {'Pepper': {'title': 'Pepper'}})\n"
        "j.write(project, pathlib.Path('/a/greeting.nepb'))\n"
        "os.kill(os.getpid(), 9)\n"
    )
    subprocess.run([sys.executable, "-c", code, str(folder)], check=False)


def test_unsaved_work_of_running_process_is_not_offered_for_recovery(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.write(GREETING, None)
    assert unsaved_work(tmp_path) == []
    journal.discard()
    assert list(tmp_path.iterdir()) == []


def test_unsaved_work_of_killed_process_is_offered_for_recovery(tmp_path: Path) -> None:
    _killed_writer(tmp_path)
    (unsaved,) = unsaved_work(tmp_path)
    assert unsaved.name == "Greeting"
    assert unsaved.path == Path("/a/greeting.nepb")
    assert unsaved.project.always.workspace.blocks == {"blocks": 1}
    assert unsaved.project.robots == {"Pepper": {"title": "Pepper"}}
    assert unsaved.edited_s == 123.0


@pytest.mark.skipif(os.name != "posix", reason="Windows does not replace a file that is open")
def test_journal_is_replaced_atomically(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.write(replace(GREETING, name="first"), None)
    (file,) = tmp_path.iterdir()
    with file.open("rb") as reader:
        journal.write(replace(GREETING, name="second, which is longer"), None)
        assert json.loads(reader.read())["name"] == "first"
    assert json.loads(file.read_bytes())["name"] == "second, which is longer"
    journal.discard()


def test_unsaved_work_is_offered_for_recovery_when_its_pid_was_reused(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.write(GREETING, None)
    (file,) = tmp_path.glob("*.json")
    entry = json.loads(file.read_bytes())
    entry["born_s"] -= 1000
    file.write_text(json.dumps(entry))
    (unsaved,) = unsaved_work(tmp_path)
    assert unsaved.project.always.workspace.blocks == WORKSPACE


def test_damaged_journal_is_skipped_and_kept(tmp_path: Path) -> None:
    _killed_writer(tmp_path)
    (good,) = tmp_path.glob("*.json")
    (tmp_path / "bad.json").write_bytes(good.read_bytes()[:40])
    assert len(unsaved_work(tmp_path)) == 1
    assert (tmp_path / "bad.json").exists()


def test_missing_journal_folder_has_no_unsaved_work(tmp_path: Path) -> None:
    assert unsaved_work(tmp_path / "none") == []


def test_unwritable_journal_folder_raises_on_write_only(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    journal = Journal(tmp_path / "file" / "journal")
    with pytest.raises(OSError, match=r"[Nn]ot a directory|cannot find|exists"):
        journal.write(GREETING, None)
    journal.discard()
    assert unsaved_work(tmp_path / "file" / "journal") == []
