"""Homes of panels: the places in the layouts in which panels are opened."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RowHome:
    """Row in a column of a layout; panels with the same column and row share it as tabs.

    Attributes:
        layout: Name of the layout.
        column: Column, counted from 0.
        row: Row in the column, counted from 0.
        height: Height of the row in px at 100 % text size; of several panels, the maximum.
        tab: Position among the panels that share the row.
        opens_with: Panel with which this one is opened for the first time; "" to open it from the start.
        tab_of: Panel to whose tabs this one is added if it can't be opened in its row; "" for the last one.
    """

    layout: str
    column: int
    row: int
    height: int
    tab: int = 0
    opens_with: str = ""
    tab_of: str = ""


@dataclass(frozen=True, slots=True)
class TabHome:
    """Tab next to another panel of a layout.

    Attributes:
        layout: Name of the layout.
        tab_of: Name of the other panel.
        min_height: Minimum height of the row in px while the panel is open.
    """

    layout: str
    tab_of: str
    min_height: int = 0


@dataclass(frozen=True, slots=True)
class BottomHome:
    """Place below all columns of a layout.

    Attributes:
        layout: Name of the layout.
        height: Height in px.
    """

    layout: str
    height: int


Home = RowHome | TabHome | BottomHome
"""Place of a panel in one layout."""
