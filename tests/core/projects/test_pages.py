"""Tests of projects with several pages: file, journal, recovery, fixes and hostile files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.blocks.model.project import Page, Project
from app.blocks.model.workspace_json import WorkspaceJson
from app.core.projects.file_format import encode_file, parse_file, read_file, write_file
from app.core.projects.journal import Journal, unsaved_work
from app.core.projects.open_project import OpenProject
from app.errors import DocumentError
from tests.blocks.samples import block, call, started, text, workspace, write

ALWAYS = workspace(started(write(text("a"))))
SAVED_PAGE = {"id": "greet", "name": "Greet", "kind": "reaction", "workspace": ALWAYS}


def page(id: str, saved: dict[str, object]) -> Page:
    return Page(id, id.title(), "reaction", WorkspaceJson.from_blocks(saved))


@pytest.fixture
def project() -> Project:
    made = Project.of_blocks("Mine", ALWAYS, {"Pepper": {"title": "P"}}, {"later": [1]})
    return made.with_page(page("greet", workspace(started(write(text("b"))))))


@pytest.fixture
def document(tmp_path: Path, project: Project) -> OpenProject:
    path = tmp_path / "Mine.nepb"
    write_file(path, project)
    made = OpenProject(lambda: Journal(tmp_path / "journal"))
    made.open(path)
    return made


def test_pages_are_saved_and_read(project: Project, tmp_path: Path) -> None:
    path = tmp_path / "Mine.nepb"
    write_file(path, project)
    assert json.loads(path.read_bytes())["version"] == 2
    assert read_file(path) == project
    write_file(path, read_file(path))
    assert read_file(path) == project


def test_file_with_one_page_is_saved_byte_by_byte_as_in_version_1(tmp_path: Path) -> None:
    content = {
        "format": "nep-behaviour", "version": 1, "name": "Mine", "workspace": ALWAYS,
        "robots": {"Pepper": {"title": "P"}}, "pages": "of somebody else", "later": [1],
    }  # fmt: skip
    path = tmp_path / "Mine.nepb"
    path.write_text(json.dumps(content, indent=1), "utf-8")
    before = path.read_bytes()
    made = OpenProject(lambda: Journal(tmp_path / "journal"))
    made.open(path)
    made.save()
    assert path.read_bytes() == before


def test_unfinished_edit_of_a_page_survives_a_crash(
    document: OpenProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    edited = workspace(started(write(text("c"))))
    document.apply_edit(WorkspaceJson(json.dumps(edited)), "greet")
    monkeypatch.setattr("app.core.projects.journal._is_running", lambda *_process: False)
    (unsaved,) = unsaved_work(tmp_path / "journal")
    assert unsaved.project == document.project
    after = OpenProject(lambda: Journal(tmp_path / "journal"))
    after.recover(unsaved)
    assert after.project.page("greet").workspace.blocks == edited
    assert after.project.unknown_fields == {"later": [1]}
    after.save()
    assert read_file(tmp_path / "Mine.nepb") == after.project


def test_program_has_the_new_name_after_renaming_and_saving_as(document: OpenProject, tmp_path: Path) -> None:
    assert document.program().name == "Mine"
    document.rename_to("Other")
    assert document.program().name == "Other"
    document.save(tmp_path / "Third.nepb")
    assert document.program().name == "Third"


def test_fix_of_a_block_changes_its_page_only(document: OpenProject) -> None:
    document.apply_edit(workspace(started(call("f", id="call"))), "greet")
    (problem,) = document.program().errors
    assert problem.block_id == "greet/call"
    assert problem.fix_action is not None
    assert document.fix(problem.fix_action)
    assert document.program().errors == ()
    assert document.project.always.workspace.blocks == ALWAYS


def test_fix_with_a_name_that_looks_like_a_page_changes_the_first_page(document: OpenProject) -> None:
    document.apply_edit(workspace(started(block("events_broadcast", NAME="greet/all"))))
    (problem,) = document.program().problems
    assert problem.fix_action is not None
    assert document.fix(problem.fix_action)
    assert document.program().problems == ()
    assert document.project.page("greet").workspace.blocks != ALWAYS
    assert "greet/all" in document.project.always.workspace.text
    assert "greet/all" not in document.project.page("greet").workspace.text


@pytest.mark.parametrize("pages", [
    7, None, {}, [7], [{}], [SAVED_PAGE, SAVED_PAGE],
    *([SAVED_PAGE | {"id": id}] for id in ("always", "", "../x", "a/b", "a:b", "A", "a" * 41, 3, None)),
    *([SAVED_PAGE | {"kind": kind}] for kind in ("always", "other", [], None)),
    *([SAVED_PAGE | {"workspace": saved}] for saved in (None, [], "x")),
    [SAVED_PAGE | {"name": None}],
])  # fmt: skip
def test_file_with_invalid_pages_is_rejected_with_reason(pages: object) -> None:
    content = {"format": "nep-behaviour", "version": 2, "workspace": ALWAYS, "robots": {}, "pages": pages}
    with pytest.raises(DocumentError) as caught:
        parse_file(json.dumps(content).encode(), Path("x.nepb"))
    assert caught.value.reason == "x.nepb is damaged or not a behaviour"
    assert caught.value.advice == "open an earlier copy"


def test_very_deep_page_of_a_file_opens_and_compiles(project: Project, tmp_path: Path) -> None:
    deep = b'{"a":' * 3000 + b"1" + b"}" * 3000
    data = encode_file(project).replace(b'"workspace": {', b'"workspace": {"x": ' + deep + b",")
    path = tmp_path / "Deep.nepb"
    path.write_bytes(data)
    made = OpenProject(lambda: Journal(tmp_path / "journal"))
    made.open(path)
    assert made.program().starts == 2
    made.apply_edit(ALWAYS, "greet")
    assert made.project.page("greet").workspace.blocks == ALWAYS
