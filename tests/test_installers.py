"""Tests of the files that associate .nepb files with Studio: desktop entry, MIME type, registry."""

from __future__ import annotations

import configparser
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from app.core.projects.file_format import SUFFIX

FOLDER = Path(__file__).parents[1] / "installers"
TYPE = "application/x-nep-behaviour"
DESKTOP = FOLDER / "linux" / "nep-studio.desktop"
MIME = "{http://www.freedesktop.org/standards/shared-mime-info}"


def test_desktop_file_opens_several_nepb_files() -> None:
    parser = configparser.ConfigParser(interpolation=None)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(DESKTOP, "utf-8")
    entry = parser["Desktop Entry"]
    assert entry["Type"] == "Application"
    assert entry["Exec"] == "nep-studio %F"
    assert entry["MimeType"] == f"{TYPE};"
    for action in entry["Actions"].split(";"):
        assert not action or parser[f"Desktop Action {action}"]["Exec"] == "nep-studio --new-window"


@pytest.mark.skipif(shutil.which("desktop-file-validate") is None, reason="needs desktop-file-utils")
def test_desktop_file_is_valid() -> None:
    done = subprocess.run(["desktop-file-validate", DESKTOP], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_mime_type_matches_the_file_suffix() -> None:
    (kind,) = ET.parse(FOLDER / "linux" / "nep-studio-mime.xml").getroot().iter(f"{MIME}mime-type")
    assert kind.get("type") == TYPE
    assert [glob.get("pattern") for glob in kind.iter(f"{MIME}glob")] == [f"*{SUFFIX}"]


def test_windows_registry_opens_the_file_as_one_argument() -> None:
    text = (FOLDER / "windows" / "nep-studio.reg").read_text("utf-8")
    assert text.startswith("Windows Registry Editor Version 5.00\n\n")
    keys = re.findall(r"^\[HKEY_CURRENT_USER\\Software\\Classes\\(.+)\]$", text, re.MULTILINE)
    assert keys[0] == SUFFIX
    values = [line for line in text.splitlines() if line and line[0] in '@"']
    assert values
    for line in values:
        assert re.fullmatch(r'(@|"[^"]+")="((?:[^"\\]|\\["\\])*)"', line), line
    command = text.partition(r"shell\open\command]")[2]
    assert r"\"%1\"" in command
    assert f'"Content Type"="{TYPE}"' in text
