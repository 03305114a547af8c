"""Tests that the hardened runtime gets only documented entitlements, and as few as possible."""

from __future__ import annotations

import plistlib
import sys
from pathlib import Path

import PySide6
import pytest

from installers.macos.entitlements import (
    DOCUMENTED,
    QT_WEB_PROCESS,
    STUDIO,
    WEB_PROCESS,
    problems,
    source_of,
    write,
)

CS = "com.apple.security.cs."


@pytest.mark.parametrize("allowed", [STUDIO, WEB_PROCESS])
def test_every_entitlement_is_documented_by_apple(allowed: dict[str, str], tmp_path: Path) -> None:
    read = plistlib.loads(write(tmp_path / "a.entitlements", allowed).read_bytes())
    assert read == dict.fromkeys(allowed, True)
    assert read.keys() <= DOCUMENTED.keys()
    assert all(allowed.values()), "each has its reason"


def test_documented_keys_match_the_hardened_runtime_page_of_apple() -> None:
    # The page's two groups as of November 2026: six exceptions and seven resources.
    groups = {
        CS: "allow-jit allow-unsigned-executable-memory allow-dyld-environment-variables debugger "
        "disable-library-validation disable-executable-page-protection",
        "com.apple.security.device.": "audio-input camera",
        "com.apple.security.personal-information.": "location addressbook calendars photos-library",
        "com.apple.security.automation.": "apple-events",
    }
    listed = {f"{group}{name}" for group, names in groups.items() for name in names.split()}
    assert set(DOCUMENTED) == listed


def test_every_documented_key_has_its_page_and_unknown_keys_raise() -> None:
    pages = {source_of(key) for key in DOCUMENTED}
    assert len(pages) == len(DOCUMENTED)
    assert all(each.startswith("https://developer.apple.com/documentation/") for each in pages)
    with pytest.raises(KeyError, match="get-task-allow"):
        source_of("com.apple.security.get-task-allow")


def test_misspelt_entitlement_is_detected(tmp_path: Path) -> None:
    wrong = f"{CS}disable-executable-apge-protection"
    assert problems({wrong: True}) == [f"Apple documents no '{wrong}'"]
    with pytest.raises(ValueError, match="apge"):
        write(tmp_path / "a.entitlements", {wrong: "a reason"})
    assert not (tmp_path / "a.entitlements").exists()


@pytest.mark.parametrize("value", [False, "true", 1])
def test_entitlement_that_is_not_true_is_rejected(value: object) -> None:
    assert problems({f"{CS}allow-jit": value}) == [f"'{CS}allow-jit' must be true or omitted"]


def test_web_process_has_the_entitlements_of_qt_except_library_validation() -> None:
    assert set(WEB_PROCESS) == QT_WEB_PROCESS - {f"{CS}disable-library-validation"}


def test_studio_has_fewer_entitlements_than_its_web_process() -> None:
    assert set(STUDIO) < set(WEB_PROCESS)
    assert not any(".device." in key or ".personal-information." in key for key in STUDIO)


@pytest.mark.skipif(sys.platform != "darwin", reason="only Qt for macOS has a list of its own")
def test_known_qt_entitlements_match_the_shipped_ones() -> None:
    (path,) = Path(PySide6.__file__).parent.glob(
        "Qt/lib/QtWebEngineCore.framework/Helpers/QtWebEngineProcess.app/Contents/Resources/*.entitlements"
    )
    assert plistlib.loads(path.read_bytes()) == dict.fromkeys(QT_WEB_PROCESS, True)
