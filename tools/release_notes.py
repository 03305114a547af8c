"""Print the notes of a release from CHANGELOG.md. Uses only the standard library.

    python3 -m tools.release_notes v1.2.3                   the version's section as Markdown
    python3 -m tools.release_notes v1.2.3 --links ADDRESS   with links to project files below ADDRESS

Exits with 1 and a message if the tag isn't the version in nep/version.py, or if the changelog has no
section for the version. In this case .github/workflows/release.yml builds nothing.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from nep.version import __version__

CHANGELOG = Path(__file__).resolve().parents[1] / "CHANGELOG.md"
_LINK_TO_FILE = re.compile(r"\]\((?![a-z]+:|#)([^)\s]+)\)")


class InvalidReleaseError(Exception):
    """Error for an invalid release; the message contains the reason and the fix."""


def checked_version(tag: str, version: str = __version__) -> str:
    """Return the version that a tag such as "v1.2.3" names.

    Args:
        tag: The tag, with or without its "v".
        version: Version of the project.

    Raises:
        InvalidReleaseError: The tag doesn't match the version.
    """
    if tag.removeprefix("v") != version:
        raise InvalidReleaseError(f"the tag '{tag}' doesn't match nep/version.py, which has '{version}'")
    return version


def section(changelog: str, version: str) -> str:
    """Return the text below the heading of a version.

    Args:
        changelog: Text of CHANGELOG.md.
        version: Version without "v".

    Raises:
        InvalidReleaseError: The section is missing or empty.
    """
    parts = re.split(r"^## (.+)$\n?", changelog, flags=re.MULTILINE)
    for heading, text in zip(parts[1::2], parts[2::2], strict=True):
        if heading.split()[0].strip("[]") == version:
            if not text.strip():
                raise InvalidReleaseError(f"the section '## {version}' of CHANGELOG.md is empty")
            return text.strip() + "\n"
    raise InvalidReleaseError(f"CHANGELOG.md has no section '## {version}'; rename its section 'Unreleased'")


def with_links(text: str, address: str) -> str:
    """Return the Markdown text with its relative links changed to absolute ones below `address`."""
    return _LINK_TO_FILE.sub(rf"]({address.rstrip('/')}/\1)", text)


def main(arguments: Sequence[str] | None = None, changelog: Path = CHANGELOG) -> int:
    """Print the release notes; return 1 if the release is invalid."""
    parser = argparse.ArgumentParser(
        prog="release_notes", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("tag", help="the tag, with or without the v")
    parser.add_argument("--links", metavar="ADDRESS", help="URL of the project's files")
    options = parser.parse_args(arguments)
    try:
        notes = section(changelog.read_text(encoding="utf-8"), checked_version(options.tag))
    except InvalidReleaseError as error:
        print(f"release notes: {error}", file=sys.stderr)
        return 1
    sys.stdout.buffer.write((with_links(notes, options.links) if options.links else notes).encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
