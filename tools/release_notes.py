"""The notes of a release, out of CHANGELOG.md. Standard library only.

    python3 -m tools.release_notes v1.2.3                   the section of that version, as Markdown
    python3 -m tools.release_notes v1.2.3 --links ADDRESS   with links to files of the project below ADDRESS

Exit code 1 and a sentence when the tag is not the version of nep/version.py, or the changelog has no section
of it: .github/workflows/release.yml builds nothing then.
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


class RefusedError(Exception):
    """This is no release; the text says why, and what to do."""


def checked_version(tag: str, version: str = __version__) -> str:
    """The version that a tag stands for. Raises `RefusedError` when it is not the project's."""
    if tag.removeprefix("v") != version:
        raise RefusedError(f"'{tag}' is not the version of nep/version.py, which says '{version}'")
    return version


def section(changelog: str, version: str) -> str:
    """What stands below the heading of a version. Raises `RefusedError` when that is nothing."""
    parts = re.split(r"^## (.+)$\n?", changelog, flags=re.MULTILINE)
    for heading, text in zip(parts[1::2], parts[2::2], strict=True):
        if heading.split()[0].strip("[]") == version:
            if not text.strip():
                raise RefusedError(f"CHANGELOG.md says nothing of {version}")
            return text.strip() + "\n"
    raise RefusedError(
        f"CHANGELOG.md has no section '## {version}'; write one, of what stands under 'Unreleased' now"
    )


def with_links(text: str, address: str) -> str:
    """The text with its links to files pointing below an address: what reads it there has no files."""
    return _LINK_TO_FILE.sub(rf"]({address.rstrip('/')}/\1)", text)


def main(arguments: Sequence[str] | None = None, changelog: Path = CHANGELOG) -> int:
    """Print the notes; 1 when this is no release."""
    parser = argparse.ArgumentParser(
        prog="release_notes", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("tag", help="the tag, with or without its v")
    parser.add_argument("--links", metavar="ADDRESS", help="where the files of the project can be read")
    options = parser.parse_args(arguments)
    try:
        notes = section(changelog.read_text(encoding="utf-8"), checked_version(options.tag))
    except RefusedError as refused:
        print(f"release notes: {refused}", file=sys.stderr)
        return 1
    sys.stdout.buffer.write((with_links(notes, options.links) if options.links else notes).encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
