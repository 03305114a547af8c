"""Tests of tools/release_notes.py: the section of a version in the changelog, and invalid versions."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from nep.version import __version__
from tools.release_notes import CHANGELOG, InvalidReleaseError, checked_version, main, section, with_links

TEXT = """# Changelog

The newest is on top.

## Unreleased

### Added

- What nobody has yet.

## [1.10.0] - 2026-12-01

### Added

- Pictures, see [the guide](docs/web.md).

## 1.1.0 (2026-11-01)

- An older thing.

## 1.0.0
"""


def test_section_ends_at_the_next_heading() -> None:
    assert section(TEXT, "1.10.0") == "### Added\n\n- Pictures, see [the guide](docs/web.md).\n"
    assert section(TEXT, "1.1.0") == "- An older thing.\n"


@pytest.mark.parametrize("version", ["1.1", "10.0", "1.10.0rc1", "2026-12-01", "1.10"])
def test_similar_version_is_not_matched(version: str) -> None:
    with pytest.raises(InvalidReleaseError, match="no section '## "):
        section(TEXT, version)


def test_empty_section_is_rejected() -> None:
    with pytest.raises(InvalidReleaseError, match=r"1\.0\.0' of CHANGELOG\.md is empty"):
        section(TEXT, "1.0.0")


def test_tag_must_match_the_version_of_the_sources() -> None:
    assert checked_version("v1.2.3", "1.2.3") == checked_version("1.2.3", "1.2.3") == "1.2.3"
    for tag in ("v1.2.4", "v1.2", "vv1.2.3", "release-1.2.3", ""):
        with pytest.raises(InvalidReleaseError, match=r"doesn't match nep/version\.py"):
            checked_version(tag, "1.2.3")


def test_relative_links_become_absolute_and_other_links_are_unchanged() -> None:
    text = "[guide](docs/web.md), [there](https://example.org/a.md), [below](#added), [x](mailto:a@b.org)"
    assert with_links(text, "https://example.org/blob/v1/") == text.replace(
        "](docs/", "](https://example.org/blob/v1/docs/"
    )


def test_command_prints_the_notes_or_an_error(
    tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    changelog = tmp_path / "CHANGELOG.md"
    changelog.write_text(
        f"# Changelog\n\n## {__version__}\n\n- Ñandú, [how](docs/web.md)\n", encoding="utf-8"
    )
    assert main([f"v{__version__}", "--links", "https://example.org"], changelog) == 0
    assert capfdbinary.readouterr().out == "- Ñandú, [how](https://example.org/docs/web.md)\n".encode()
    changelog.write_text("# Changelog\n\n## Unreleased\n\n- x\n", encoding="utf-8")
    for tag in (f"v{__version__}", "v99.0.0"):
        assert main([tag], changelog) == 1
        said = capfdbinary.readouterr()
        assert said.out == b""
        assert said.err.startswith(b"release notes: ")


def test_newest_section_of_the_changelog_is_found() -> None:
    text = CHANGELOG.read_text(encoding="utf-8")
    newest = re.findall(r"^## (\S+)", text, re.MULTILINE)[0]
    assert section(text, newest).startswith("### ")
