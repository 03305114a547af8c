"""Create resources/icons/lucide.txt, a file with all icons, from the npm package lucide-static.

    npm pack lucide-static@1.62.0 && tar xzf lucide-static-1.62.0.tgz
    python3 tools/icons.py package

Each line contains the name of an icon, a tab and the content of its <svg>. Lines are sorted by name.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

TARGET = Path(__file__).resolve().parents[1] / "resources" / "icons"
SVG_PATTERN = re.compile(r"\s*(?:<!--.*?-->\s*)?<svg\b[^>]*>(.*)</svg>\s*", re.DOTALL)


def svg_content(svg: str) -> str:
    """Return the content of the <svg> element as one line.

    Raises:
        ValueError: The text isn't a Lucide icon.
    """
    match = SVG_PATTERN.fullmatch(svg)
    if match is None:
        raise ValueError("no svg element")
    return re.sub(r"\s*/>", "/>", re.sub(r">\s+<", "><", match.group(1).strip()))


def main(package: Path) -> int:
    """Write lucide.txt and the licence; return the exit code."""
    lines = [
        f"{path.stem}\t{svg_content(path.read_text('utf-8'))}\n"
        for path in sorted((package / "icons").glob("*.svg"))
    ]
    (TARGET / "lucide.txt").write_text("".join(lines), "utf-8")
    (TARGET / "LICENSE.txt").write_text((package / "LICENSE").read_text("utf-8"), "utf-8")
    sys.stdout.write(f"{len(lines)} icons\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(Path(sys.argv[1])))
