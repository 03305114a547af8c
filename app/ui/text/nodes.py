"""Formatting of properties of nodes: NEP version and CPU use."""

from __future__ import annotations

from app.core.network.nodes import NodeEntry
from app.core.networks.kinds import find_kind
from nep.i18n import _, lazy, number

GENERATIONS = {
    "native": lazy("native"),
    "A": lazy("NEP up to 0.5.4.5"),
    "B": "NEP 0.5.4.8",
}


def generation_text(node: NodeEntry) -> str:
    """Return "native", the version of the original NEP, or the name of the other network."""
    kind = find_kind(node.network)
    if kind is not None:
        return kind.product_name
    return _(GENERATIONS.get(node.generation, f"NEP {node.generation}"))


def cpu_text(ratio: float | None) -> str:
    """Format a share of a core, such as "0.4 %", "12 %" or "130 %"; "" if it is unknown."""
    if ratio is None:
        return ""
    percent = ratio * 100
    return f"{number(percent, '.1f')} %" if percent < 9.95 else f"{round(percent)} %"
