"""Tests of layout files: export, import by dialog or drop, and rejection of invalid files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.ui.shell.commands.commands import Commands
from app.ui.shell.docking.layout_file import LayoutFileError, decode_layout, encode_layout
from app.ui.shell.main_window import MainWindow
from tests.ui.shell_parts import Answers

pytest_plugins = ["tests.ui.shell_fixtures"]

SAVED = {"open": ["topics", "plot", "plot#2"], "docks": "", "panels": {"topics": {"filter": "/arm"}}}
PANELS = ("topics", "inspector", "plot")


def changed(**values: object) -> bytes:
    return json.dumps({**json.loads(encode_layout("Mine", "developer", SAVED)), **values}).encode()


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_layout_file_round_trips_in_utf_8_and_utf_16(encoding: str):
    saved = encode_layout("Mine", "developer", SAVED).decode().encode(encoding)
    found = decode_layout(saved, "file", PANELS)
    assert (found.name, found.base, found.saved, found.unknown_panels) == ("Mine", "developer", SAVED, ())


def test_unknown_panels_of_a_layout_are_reported_once_and_skipped():
    found = decode_layout(encode_layout("Mine", "developer", SAVED), "file", ("topics",))
    assert (found.saved["open"], found.unknown_panels) == (["topics"], ("plot",))
    found = decode_layout(encode_layout("Mine", "developer", SAVED), "file", ("plot",))
    assert (found.saved["open"], found.saved["panels"], found.unknown_panels) == (
        ["plot", "plot#2"],
        {},
        ("topics",),
    )


@pytest.mark.parametrize(
    ("name", "shown"),
    [("  two\n words\u202e ", "two words"), ("x" * 50, "x" * 40), ("", "the file"), (7, "the file"),
     ("\x00", "the file")],
)  # fmt: skip
def test_layout_name_is_reduced_to_a_short_single_line(name, shown):
    assert decode_layout(changed(name=name), "the file", PANELS).name == shown


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "it is damaged or not a Studio layout"),
        (b"\xff\xfe", "it is damaged or not a Studio layout"),
        (b"[" * 100_000, "it is damaged or not a Studio layout"),
        (b"[]", "it isn't a Studio layout"),
        (b'{"format": "another"}', "it isn't a Studio layout"),
        (changed(arrangement={**SAVED, "docks": "AAAA"}), "the file is damaged"),
        (changed(sum=None), "the file is damaged"),
        (changed(version=2), "it was saved by a newer version of Studio; update Studio to open it"),
        (changed(version=0), "the file is damaged"),
        (changed(version="1"), "the file is damaged"),
        (changed(base="start"), "it is based on a layout that this version of Studio doesn't have"),
        (changed(base=["developer"]), "it is based on a layout that this version of Studio doesn't have"),
        (changed(arrangement=[]), "the file is damaged"),
        (changed(arrangement={"open": 3, "docks": ""}), "the file is damaged"),
        (changed(arrangement={"open": [], "docks": 3}), "the file is damaged"),
    ],
)
def test_invalid_layout_file_is_rejected_with_a_reason(data, sentence):
    with pytest.raises(LayoutFileError, match=f"^{sentence}$"):
        decode_layout(data, "file", PANELS)


def test_layout_is_exported_imported_and_import_can_be_undone(
    window: MainWindow, commands: Commands, answers: Answers, tmp_path: Path
):
    window.show()
    commands.run("layout.developer")
    for name in set(window.bench.open_names()) - {"topics", "console"}:
        window.bench.docks[name].close()
    file = tmp_path / "Mine.nep-layout"
    answers.path = file
    commands.run("layout.export")
    assert window.toast.text == "Saved the layout to Mine.nep-layout"
    commands.run("layout.reset")
    before = set(window.bench.open_names())
    assert before > {"topics", "console"}
    commands.run("layout.open")
    assert answers.asked[-1].startswith("layout ")
    assert set(window.bench.open_names()) == {"topics", "console"}
    assert window.toast.text == "Opened the layout “Developer 2”"  # “Developer” is a built-in layout
    window.toast.button.click()
    assert set(window.bench.open_names()) == before
    assert window.saved_layouts.all() == ()
    saved = json.loads(file.read_bytes())["arrangement"]
    saved["open"].append("teleport")
    file.write_bytes(encode_layout("Arm", "developer", saved))
    for name in ("Arm", "Arm 2"):
        commands.files.open_all([file])  # like a drop or the command line
        assert window.toast.text == f"Opened the layout “{name}”. Unknown panels were skipped: teleport"
        assert set(window.bench.open_names()) == {"topics", "console"}
    file.write_bytes(encode_layout("Arm", "developer", {**saved, "docks": ""}))  # Qt can't restore them
    commands.files.open_all([file])
    assert window.toast.text == "Can't open Mine.nep-layout: the file is damaged"
    assert set(window.bench.open_names()) == {"topics", "console"}
    assert [each.name for each in window.saved_layouts.all()] == ["Arm", "Arm 2"]
    file.write_bytes(b"nothing of the kind")
    commands.files.open_all([file])
    assert window.toast.text == "Can't open Mine.nep-layout: it is damaged or not a Studio layout"
    commands.files.open_all([tmp_path / "gone.nep-layout"])
    assert window.toast.text == "Can't open gone.nep-layout: no such file or directory"
    answers.path = tmp_path / "a file" / "x.nep-layout"
    answers.path.parent.write_bytes(b"in its place")
    commands.run("layout.export")
    assert window.toast.text.startswith("Can't write x.nep-layout: ")
