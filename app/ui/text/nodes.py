"""Formatting of properties of nodes: generation and CPU use."""

from __future__ import annotations

from app.core.network.nodes import NodeEntry
from app.core.networks.kinds import find_kind
from nep.i18n import _, lazy, number

GENERATION_LABELS = {
    "native": lazy("native"),
    "A": lazy("NEP up to 0.5.4.5"),
    "B": "NEP 0.5.4.8",
}


def generation_text(node: NodeEntry) -> str:
    """Return the generation of a node: "native", the version of NEP, or the name of another network."""
    kind = find_kind(node.network)
    if kind is not None:
        return kind.product_name
    return _(GENERATION_LABELS.get(node.generation, f"NEP {node.generation}"))


def cpu_text(ratio: float | None) -> str:
    """Format the CPU use of a node, such as "0.4 %", "12 %" or "130 %"; "" if it is unknown.

    Args:
        ratio: CPU use as a share of one core, or None.
    """
    if ratio is None:
        return ""
    percent = ratio * 100
    return f"{number(percent, '.1f')} %" if percent < 9.95 else f"{round(percent)} %"
