"""Tests on a disk that is full: no file is lost, failures are reported, and writing resumes with space."""

from __future__ import annotations

import pytest

from tests.small_disk import SmallDisk

FULL = """
import json, sys
from pathlib import Path
from app.blocks.model.project import Project
from app.core.messages import snapshots
from app.core.projects.file_format import write_file
from app.core.projects.open_project import OpenProject
from app.core.projects.versions import save_version
from app.core.projects.journal import Journal, unsaved_work
from app.core.storage.settings import Settings
from app.errors import AppError
from nep.messages.message import Message

disk = Path(sys.argv[1])

def blocks(id):
    return {"blocks": {"languageVersion": 0, "blocks": [{"type": "events_started", "id": id}]}}

def said(work):
    try:
        work()
    except (AppError, OSError) as error:
        return f"{type(error).__name__}: {error}"
    return "done"

def parts():
    return sorted(str(each.relative_to(disk)) for each in disk.rglob("*") if each.suffix == ".part")

path = disk / "Mine.nepb"
write_file(path, Project.of_blocks("Mine", blocks("old"), {}))
old = path.read_bytes()
settings = Settings(disk / "home")
settings.theme = "dark"
document = OpenProject(lambda: Journal(disk / "journal"))
document.open(path)
document.apply_edit(blocks("first"))
kept = [each.read_bytes() for each in (disk / "journal").glob("*.json")]
shape = {"shape": [64, 64, 3], "encoding": "bgr8"}
picture = Message("/cam", bytes(range(256)) * 48, "image", "image", stamp_ns=1, extension=shape)

filler = disk / "filler"
with filler.open("wb", buffering=0) as file:
    try:
        while True:
            file.write(b"x" * 4096)
    except OSError as error:
        full = error.strerror

told = {"full": full}
document.apply_edit(blocks("y" * 50_000))
told["edit"] = document.journal_error
told["save"] = said(document.save)
told["setting"] = said(lambda: setattr(settings, "shortcuts", {"x": ["x" * 20_000]}))
told["earlier"] = said(lambda: save_version(path, disk / "earlier"))
told["snapshot"] = said(lambda: snapshots.save(picture, disk / "pictures"))
told["dirty"] = document.dirty
told["old"] = path.read_bytes() == old
told["journal"] = [each.read_bytes() for each in (disk / "journal").glob("*.json")] == kept
told["settings"] = Settings(disk / "home").theme
told["parts"] = parts()
told["pictures"] = [each.name for each in (disk / "pictures").iterdir()]

filler.unlink()
document.apply_edit(blocks("z" * 50_000))
told["edit then"] = document.journal_error
told["save then"] = said(document.save)
again = OpenProject(lambda: Journal(disk / "journal"))
again.open(path)
told["read then"] = again.workspace == blocks("z" * 50_000)
told["setting then"] = said(lambda: setattr(settings, "theme", "light"))
told["theme then"] = Settings(disk / "home").theme
told["snapshot then"] = said(lambda: snapshots.save(picture, disk / "pictures"))
told["parts then"] = parts()
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    """Results of the script that runs on a disk of 256 kB."""
    return SmallDisk(tmp_path_factory.mktemp("disk")).run(FULL)


def test_full_disk_loses_nothing_and_every_failure_is_reported(told: dict[str, object]) -> None:
    full = told["full"]
    assert told["edit"] == f"can't back up unsaved work ({full}); save the file now"
    assert told["save"] == (
        f"DocumentError: can't write Mine.nepb ({full}); free some space or choose another folder"
    )
    assert str(told["setting"]).startswith("SettingsError: ")
    assert str(told["earlier"]).startswith("DocumentError: Mine.nepb wasn't saved: its previous version")
    assert str(full) in str(told["snapshot"])
    assert told["dirty"] is True
    assert told["old"] is True, "the behaviour's file is what it was"
    assert told["journal"] is True, "and so is what was kept of the unsaved work"
    assert told["settings"] == "dark"
    assert told["parts"] == []
    assert told["pictures"] == [], "half a picture is none"


def test_all_writes_succeed_after_space_is_freed(told: dict[str, object]) -> None:
    assert told["edit then"] is None
    assert told["save then"] == told["setting then"] == told["snapshot then"] == "done"
    assert told["read then"] is True
    assert told["theme then"] == "light"
    assert told["parts then"] == []
