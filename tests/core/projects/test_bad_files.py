"""Tests of behaviour files that are damaged, truncated, of another version or can't be saved."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
from pathlib import Path

import pytest

from app import resources
from app.blocks.model.project import Project
from app.core.projects.file_format import parse_file, read_file, write_file
from app.core.projects.journal import Journal, unsaved_work
from app.core.projects.open_project import OpenProject
from app.errors import DocumentError
from app.intents import AddTimeLimit

ROOT = Path(__file__).parents[3]
posix = pytest.mark.skipif(os.name != "posix", reason="signals and limits of Unix")
FULL = """
import json, resource, signal, sys
from pathlib import Path
from app.core.projects.open_project import OpenProject
from app.core.projects.journal import Journal
from app.errors import DocumentError
path, journals = Path(sys.argv[1]), Path(sys.argv[2])
document = OpenProject(lambda: Journal(journals))
document.open(path)
document.apply_edit({"blocks": {"blocks": [{"type": "events_started", "id": "x" * 200000}]}})
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, resource.RLIM_INFINITY))
try:
    document.save()
    said = "saved"
except DocumentError as error:
    said = str(error)
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
print(json.dumps({"said": said, "dirty": document.dirty, "journal": document.journal_name}))
"""


def behaviour(path: Path, *blocks: dict[str, object], **others: object) -> Path:
    workspace = {"blocks": {"languageVersion": 0, "blocks": list(blocks)}}
    write_file(path, Project.of_blocks(path.stem, workspace, {}, others))
    return path


@posix
def test_full_disk_keeps_old_file_and_unsaved_work(tmp_path: Path) -> None:
    path = behaviour(tmp_path / "Mine.nepb", {"type": "events_started", "id": "old"})
    before = path.read_bytes()
    done = subprocess.run(
        [sys.executable, "-c", FULL, path, tmp_path / "journal"],
        capture_output=True, text=True, timeout=60, check=True, cwd=ROOT,
    )  # fmt: skip
    told = json.loads(done.stdout)
    assert told["said"].startswith("can't write Mine.nepb (")
    assert told["said"].endswith("free some space or choose another folder")
    assert told["dirty"] is True
    assert path.read_bytes() == before
    assert [each.name for each in tmp_path.iterdir() if each.suffix == ".part"] == [], "no half file is left"
    (left,) = unsaved_work(tmp_path / "journal")
    assert "x" * 200000 in json.dumps(left.project.always.workspace.blocks), (
        "the journal has the work of before the limit"
    )


def test_truncated_file_is_rejected_with_reason(tmp_path: Path) -> None:
    example = json.loads((resources.path("examples") / "1-greeting.nepb").read_bytes())
    example["robots"] = {"Päpper": {"title": "long"}}  # short, because every prefix of the file is parsed
    whole = json.dumps(example, ensure_ascii=False).encode()
    assert parse_file(whole, Path("x.nepb")).name == "Greeting"
    for length in range(len(whole)):
        with pytest.raises(DocumentError) as told:
            parse_file(whole[:length], Path("x.nepb"))
        assert told.value.reason == "x.nepb is damaged or not a behaviour"
        assert told.value.advice == "open an earlier copy"


def test_corrupted_file_opens_or_is_rejected_with_reason(tmp_path: Path) -> None:
    whole = (resources.path("examples") / "1-greeting.nepb").read_bytes()
    dice = random.Random(3)
    path = tmp_path / "x.nepb"
    reasons: list[str] = []
    for _ in range(300):
        data = bytearray(whole)
        for _ in range(dice.randint(1, 8)):
            data[dice.randrange(len(data))] = dice.randrange(256)
        path.write_bytes(data)
        document = OpenProject(lambda: Journal(tmp_path / "journal"))
        try:
            document.open(path)
        except DocumentError as error:
            reasons.append(error.reason)
            continue
        document.program()  # a file that opens may have problems, but must not raise an exception
    assert reasons
    assert all(reasons)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-32"])
def test_behaviour_in_another_unicode_encoding_opens(tmp_path: Path, encoding: str) -> None:
    path = behaviour(tmp_path / "Mine.nepb", {"type": "values_text", "fields": {"TEXT": "¡Hola! 🤖"}})
    written = read_file(path)
    path.write_bytes(path.read_text("utf-8").encode(encoding))
    assert read_file(path) == written


@pytest.mark.parametrize(("version", "reason"), [
    (3, "newer NEP Studio (version 3) and is unchanged; update NEP Studio"),
    (99, "newer NEP Studio"), (0, "has no format version"), (-1, "has no format version"),
    (True, "has no format version"), ("1", "has no format version"), (None, "has no format version"),
])  # fmt: skip
def test_file_of_another_version_is_rejected_with_advice_and_not_changed(tmp_path, version, reason) -> None:
    path = tmp_path / "x.nepb"
    path.write_text(json.dumps({"format": "nep-behaviour", "version": version, "workspace": {}}))
    before = path.read_bytes()
    with pytest.raises(DocumentError) as told:
        read_file(path)
    assert reason in str(told.value)
    assert path.read_bytes() == before


def test_unknown_file_content_is_preserved_on_save(tmp_path: Path) -> None:
    strange = {
        "type": "later_block", "id": "s", "x": 1.5, "y": -2, "extraState": {"a": [None, {"ü": "\ud83d"}]},
        "fields": {"F": {"deep": [1, 2.0, "x"]}}, "inputs": {"I": {"block": {"type": "other", "id": "o"}}},
        "icons": {"comment": {"text": "keep me"}}, "later": True,
    }  # fmt: skip
    wait = {"type": "control_wait_until", "id": "w", "x": 0, "y": 0}
    start = {"type": "events_started", "id": "go", "next": {"block": strange}}
    path = behaviour(tmp_path / "x.nepb", start, wait, description="what it does", later={"z": 1})
    before = json.loads(path.read_bytes().decode("utf-8", "surrogatepass"))
    document = OpenProject(lambda: Journal(tmp_path / "journal"))
    document.open(path)
    assert "s" in {each.block_id for each in document.problems()}, "it is told that it will be skipped"
    assert document.fix(AddTimeLimit("w"))
    document.save()
    after = json.loads(path.read_bytes().decode("utf-8", "surrogatepass"))
    assert json.dumps(after["workspace"]["blocks"]["blocks"][0]) == json.dumps(start), "to the byte"
    assert (after["description"], after["later"]) == (before["description"], before["later"])


@posix
@pytest.mark.timeout(240)
def test_file_is_intact_after_kills_while_saving(tmp_path: Path, pytestconfig: pytest.Config) -> None:
    kills = 100 if pytestconfig.getoption("--long") else 25
    path = tmp_path / "Mine.nepb"
    behaviour(path, {"type": "events_started", "id": "first"})
    dice = random.Random(9)
    lives = "".join(f"{dice.randint(0, 2)} {dice.randint(0, 60)}\n" for _ in range(kills))
    done = subprocess.run(
        [sys.executable, "-m", "tests.core.saving", path, tmp_path / "journal"],
        input=lives, capture_output=True, text=True, timeout=200, check=True, cwd=ROOT,
    )  # fmt: skip
    told = done.stdout.splitlines()
    assert len(told) == kills
    assert [line for line in told if not line.startswith("whole ")] == []
    assert len(set(told)) > kills // 20, "it was saved in between"
    assert path.stat().st_size > 0
    journals = list((tmp_path / "journal").glob("*.json"))
    assert journals, "some died between an edit and its save"
    left = unsaved_work(tmp_path / "journal")
    assert {each.journal for each in left} == set(journals), "a journal is whole, too"
    assert all(each.project.always.workspace.blocks["blocks"] for each in left)
