"""Write the tables of blocks in docs/blocks.md from the block definitions.

Run ``python tools/blocks_page.py`` after a change of blocks; a test fails if the page is out of date.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from app.blocks.model.block import Block  # noqa: E402
from app.blocks.toolbox.catalogue import categories  # noqa: E402
from app.blocks.toolbox.help import EXAMPLES  # noqa: E402

PAGE = ROOT / "docs" / "blocks.md"
BEGIN, END = "<!-- blocks: made by tools/blocks_page.py -->", "<!-- end of blocks -->"
_HEAD = "| block | what it does | Python |\n|---|---|---|"
_PLACEHOLDER = re.compile(r"%([A-Z_]+)")


def tables() -> str:
    """Return a Markdown table for each category: text, description and Python code of its blocks."""
    parts = []
    for category in categories():
        if category.blocks:
            rows = "\n".join(_row(block) for block in category.blocks)
            parts.append(f"### {category.title}\n\n{_HEAD}\n{rows}\n")
    return "\n".join(parts)


def page(text: str) -> str:
    """Return the text of docs/blocks.md with the current tables in place of the old ones."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{tables()}\n{END}{after}"


def _row(block: Block) -> str:
    label = " ".join(_PLACEHOLDER.sub(lambda hole: f"({hole[1].lower()})", block.text).split())
    description = " ".join(part for part in (block.tooltip, block.help, EXAMPLES[block.type]) if part)
    return f"| {label} | {description} | {_python_code(block)} |"


def _python_code(block: Block) -> str:
    if block.mutator in ("function", "call"):
        return "`def name(inputs): …`" if block.mutator == "function" else "`name(inputs)`"
    templates = (_PLACEHOLDER.sub(lambda hole: hole[1].lower(), each) for each in block.templates)
    lines = (
        re.sub(r"\s*\n\s*", " ", each).replace(" body", " …").replace(" else: else", " else: …")
        for each in templates
    )
    return f"`{' · '.join(lines)}`"


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text("utf-8")), "utf-8")
