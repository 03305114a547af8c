"""Tests that invalid behaviours and drags are parsed or rejected."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QMimeData

from app.blocks.model.project import Project
from app.core.projects.file_format import parse_file
from app.errors import DocumentError
from app.ui.widgets.field_drag import MIME_TYPE, dropped_field
from tests import hostile

BEHAVIOUR: hostile.Message = {
    "format": "nep-behaviour", "version": 1, "name": "x", "workspace": {"blocks": {"blocks": []}},
    "robots": {},
}  # fmt: skip
LISTS = tuple(hostile.payloads([["Pepper", "battery"], ["a", "b"]]))


def test_behaviours_are_parsed_or_rejected() -> None:
    read = set()
    for payload in hostile.payloads(BEHAVIOUR):
        try:
            read.add(type(parse_file(payload, Path("a.nepb"))))
        except DocumentError as error:
            read.add(DocumentError)
            assert len(str(error)) < 20_000  # noqa: PT017 - of each
    assert {Project, DocumentError} <= read


def test_dragged_field_is_parsed_or_none() -> None:
    for payload in LISTS:
        data = QMimeData()
        data.setData(MIME_TYPE, payload)
        found = dropped_field(data)
        assert found is None or len(found) == 2
