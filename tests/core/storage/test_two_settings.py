"""Tests of two Studios with the same settings file: neither overwrites the values of the other."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from app.core.storage.settings import Settings
from app.core.storage.settings_file import FORMAT_VERSION

WRITER = """
import sys
from pathlib import Path
from app.core.storage.setting import MappingSetting
from app.core.storage.settings import Settings
settings = Settings(Path(sys.argv[1]))
print("ready", flush=True)
sys.stdin.readline()
for number in range(50):
    setting = MappingSetting(f"{sys.argv[2]} {number}")
    settings.set_value(setting, {"number": number})
"""


def test_each_instance_preserves_values_set_by_the_other(tmp_path: Path) -> None:
    first, second = Settings(tmp_path), Settings(tmp_path)
    first.theme = "dark"
    second.text_percent = 150
    first.layout = "developer"
    again = Settings(tmp_path)
    assert (again.theme, again.text_percent, again.layout) == (
        "dark",
        150,
        "developer",
    )
    assert first.text_percent == 150


def test_last_write_wins_for_the_same_key(tmp_path: Path) -> None:
    first, second = Settings(tmp_path), Settings(tmp_path)
    first.theme = "dark"
    second.theme = "light"
    assert Settings(tmp_path).theme == "light"


def test_recent_files_of_both_instances_are_merged(tmp_path: Path) -> None:
    first, second = Settings(tmp_path), Settings(tmp_path)
    for settings, name in ((first, "one"), (second, "two"), (first, "three")):
        (tmp_path / name).write_text("x")
        settings.add_recent(tmp_path / name)
    assert [file.path.name for file in Settings(tmp_path).recent_files] == ["three", "two", "one"]


def test_file_damaged_by_another_program_does_not_lose_values_in_memory(tmp_path: Path) -> None:
    settings = Settings(tmp_path)
    settings.theme = "dark"
    settings.path.write_text("{ half of")
    settings.layout = "developer"
    assert json.loads(settings.path.read_text()) == {
        "theme": "dark",
        "layout": "developer",
        "format": FORMAT_VERSION,
    }


def test_concurrent_writes_of_two_processes_lose_nothing(tmp_path: Path) -> None:
    environ = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    writers = [
        subprocess.Popen(
            [sys.executable, "-c", WRITER, str(tmp_path), name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environ,
        )
        for name in ("a", "b")
    ]
    for writer in writers:
        assert writer.stdout is not None
        assert writer.stdout.readline() == "ready\n"
    for writer in writers:
        assert writer.stdin is not None
        writer.stdin.write("go\n")
        writer.stdin.flush()
    for writer in writers:
        writer.communicate(timeout=120)
        assert writer.returncode == 0
    kept = Settings(tmp_path).stored_values()
    assert [kept[f"{name} {number}"] for name in "ab" for number in range(50)] == [
        {"number": number} for number in range(50)
    ] * 2
