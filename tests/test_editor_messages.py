"""Tests of the TypeScript types generated from the messages of the block editor."""

from __future__ import annotations

from typing import Literal

import msgspec
import pytest

from app.ui.blockly.messages import VariableEdit
from tools import editor_messages


def test_types_of_the_page_are_up_to_date() -> None:
    assert editor_messages.main(["--check"]) == 0, "run python tools/editor_messages.py"


def test_outdated_file_is_reported_and_written(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(editor_messages, "ROOT", tmp_path)
    monkeypatch.setattr(editor_messages, "FILE", tmp_path / "messages.ts")
    assert editor_messages.main(["--check"]) == 1
    assert "messages.ts is out of date" in capsys.readouterr().out
    assert editor_messages.main([]) == 0
    assert editor_messages.main(["--check"]) == 0


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        (bool, "boolean"),
        (int | None, "number | null"),
        (bytes, "string"),
        (tuple[str, ...], "readonly string[]"),
        (tuple[tuple[str, str], ...], "readonly (readonly [string, string])[]"),
        (Literal["b", "a"], "'a' | 'b'"),
        (tuple[Literal["b", "a"], ...], "readonly ('a' | 'b')[]"),
        (dict[str, VariableEdit], "Record<string, VariableEdit>"),
        (object, "unknown"),
    ],
)
def test_python_type_becomes_a_typescript_type(kind: object, name: str) -> None:
    assert editor_messages.type_name(msgspec.inspect.type_info(kind)) == name


def test_type_without_an_equivalent_is_rejected() -> None:
    with pytest.raises(TypeError, match="no TypeScript type"):
        editor_messages.type_name(msgspec.inspect.type_info(complex))


def test_message_has_its_type_its_comments_and_names_in_camel_case() -> None:
    class Sample(msgspec.Struct, tag_field="type", tag="sample", rename="camel"):
        """Something happened.

        Attributes:
            can_undo: None if unknown.
        """

        can_undo: bool | None

    (struct,) = editor_messages.structs([Sample])
    assert list(editor_messages.interface(struct)) == [
        "/** Something happened. */",
        "export interface Sample {",
        "  type: 'sample';",
        "  /** null if unknown. */",
        "  canUndo: boolean | null;",
        "}",
    ]
