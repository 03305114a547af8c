"""What of a theme the page of the block editor needs, as one JSON object."""

from __future__ import annotations

from collections.abc import Callable

from app.ui.theme.tokens import Tokens


def tokens_for_page(
    tokens: Tokens, colour: Callable[[str], str], *, dark: bool, reduced_motion: bool, text_percent: int
) -> dict[str, object]:
    """All roles and block colours of the mode that shows now; ``colour`` gives a role's colour."""
    scheme = "dark" if dark else "light"
    return {
        "dark": dark,
        "colour": {role: colour(role) for role in tokens.colours[scheme]},
        "block": {
            name: {
                **parts[scheme],
                "text": tokens.block_text[name],
                "icon": tokens.block_icons[name],
            }
            for name, parts in tokens.blocks.items()
        },
        "glow": tokens.raw.get("blockGlow", {}),
        "font": {"text": tokens.families["text"], "mono": tokens.families["mono"]},
        "reducedMotion": reduced_motion,
        "textPercent": text_percent,
    }
