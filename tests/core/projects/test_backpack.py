"""Tests of the backpack: restored at the next start, shared by several Studios, no loss of items."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from app.core.projects import backpack as module
from app.core.projects.backpack import Backpack
from app.core.storage.file_lock import FileLock
from app.errors import BackpackError

WAIT = {"type": "control_wait"}
SAY = {"type": "robot_pepper_do_say", "fields": {"TEXT": "Ñandú 🎈"}}


def types(backpack: Backpack) -> list[object]:
    return [item.block["type"] for item in backpack.items]


def deep(levels: int) -> dict[str, object]:
    block: dict[str, object] = {"type": "control_wait"}
    for _ in range(levels):
        block = {"type": "control_wait", "next": {"block": block}}
    return block


def test_backpack_is_restored_at_next_start_newest_first(tmp_path: Path) -> None:
    first = Backpack(tmp_path)
    first.add([WAIT])
    first.add([SAY, deep(600)])
    again = Backpack(tmp_path)
    again.reload_if_changed()
    assert types(again) == ["robot_pepper_do_say", "control_wait", "control_wait"]
    assert again.items[0].block == SAY
    assert [item.id for item in again.items] == [item.id for item in first.items]


def test_two_studios_share_backpack_without_loss(tmp_path: Path) -> None:
    one, other = Backpack(tmp_path), Backpack(tmp_path)
    one.add([WAIT])
    other.add([SAY])  # not reloaded since the first change
    one.reload_if_changed()
    assert types(one) == types(other) == ["robot_pepper_do_say", "control_wait"]
    before = one.revision
    one.reload_if_changed()
    assert one.revision == before
    (gone,) = one.remove([item.id for item in one.items if item.block["type"] == "control_wait"])
    other.add([deep(1)])
    assert types(other) == ["control_wait", "robot_pepper_do_say"]
    one.restore([gone])
    assert types(one) == ["control_wait", "robot_pepper_do_say", "control_wait"], "where it was"
    assert one.remove(["nobody"]) == []


def test_emptied_backpack_can_be_restored(tmp_path: Path) -> None:
    backpack = Backpack(tmp_path)
    backpack.add([WAIT, SAY])
    gone = backpack.empty()
    assert (types(backpack), len(gone)) == ([], 2)
    backpack.restore(gone)
    backpack.restore(gone)
    assert types(backpack) == ["control_wait", "robot_pepper_do_say"]


@pytest.mark.parametrize(
    "content", [b"{", b"\xff\xfe", b"[]", b'{"backpack": 0, "items": []}', b'{"backpack": 1}']
)
def test_invalid_backpack_file_is_backed_up_and_reported_once(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "backpack.json").write_bytes(content)
    (tmp_path / "backpack.damaged.json").write_text("an earlier one")
    backpack = Backpack(tmp_path)
    backpack.reload_if_changed()
    kept = tmp_path / "backpack.damaged-2.json"
    assert kept.read_bytes() == content
    assert (tmp_path / "backpack.damaged.json").read_text() == "an earlier one"
    assert str(kept) in backpack.take_problem()
    assert backpack.take_problem() == ""
    backpack.add([WAIT])
    assert types(backpack) == ["control_wait"]


def test_unknown_backpack_items_are_counted_and_preserved(tmp_path: Path) -> None:
    strange: list[object] = [
        7,
        {"id": "x"},
        {"id": "y", "at": float("inf"), "block": WAIT},
        {"id": "z", "new": 1},
    ]
    good = {"id": "a", "at": 5, "block": WAIT}
    (tmp_path / "backpack.json").write_text(json.dumps({"backpack": 1, "items": [*strange, good]}))
    backpack = Backpack(tmp_path)
    backpack.reload_if_changed()
    assert types(backpack) == ["control_wait"]
    assert "4 items" in backpack.take_problem()
    backpack.add([SAY])
    backpack.empty()
    assert json.loads((tmp_path / "backpack.json").read_text())["items"] == strange
    assert backpack.take_problem() == ""


def test_backpack_limits_reject_new_items_without_loss(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MAX_STACKS", 3)
    monkeypatch.setattr(module, "MAX_BYTES", 2000)
    backpack = Backpack(tmp_path)
    backpack.add([WAIT, WAIT])
    with pytest.raises(BackpackError, match="remove something first"):
        backpack.add([SAY, SAY])
    with pytest.raises(BackpackError, match="at most 0 MB"):
        backpack.add([{"type": "x" * 3000}])
    assert types(backpack) == ["control_wait"] * 2
    again = Backpack(tmp_path)
    again.reload_if_changed()
    assert types(again) == ["control_wait"] * 2
    monkeypatch.setattr(module, "MAX_STACKS", 1)
    backpack.remove([backpack.items[0].id])  # removing is allowed even above the limit
    assert len(backpack.items) == 1


def test_unreadable_or_unwritable_backpack_raises_with_the_reason(tmp_path: Path) -> None:
    (tmp_path / "backpack.json").mkdir()
    backpack = Backpack(tmp_path)
    backpack.reload_if_changed()
    assert "can't read " in backpack.take_problem()
    with pytest.raises(BackpackError, match="can't read "):
        backpack.add([WAIT])
    (tmp_path / "backpack.json").rmdir()
    (tmp_path / "file").write_text("")
    with pytest.raises(BackpackError, match="can't save "):
        Backpack(tmp_path / "file").add([WAIT])


@pytest.mark.skipif(os.name != "posix", reason="modes are POSIX's")
def test_backpack_file_is_private_to_its_owner(tmp_path: Path) -> None:
    backpack = Backpack(tmp_path)
    backpack.add([WAIT])
    assert backpack.path.stat().st_mode & 0o077 == 0


def test_long_held_lock_does_not_block_backpack(tmp_path: Path) -> None:
    lock = FileLock(tmp_path / "backpack.json")
    assert lock.acquire()
    backpack = Backpack(tmp_path)
    backpack.add([WAIT])
    lock.release()
    assert types(backpack) == ["control_wait"]
