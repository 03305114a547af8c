"""Inspector panel: newest message of one topic as a tree, table or bytes.

`body` switches between these pages and the empty states; `diff` compares two messages.
"""

from app.ui.panels.watch.inspector.panel import PANEL as PANEL
