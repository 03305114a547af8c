"""Inspector: the newest message of one topic as a tree, or its bytes.

`body` changes between tree, bytes and sentences; `diff` compares two messages.
"""

from app.ui.panels.inspector.panel import PANEL as PANEL
