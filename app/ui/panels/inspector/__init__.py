"""Inspector: the newest message of one topic as a tree, or its bytes."""

from app.ui.panels.inspector.panel import PANEL as PANEL
