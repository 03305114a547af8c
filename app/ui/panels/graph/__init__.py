"""Graph panel: nodes and the topics between them, with rates, grouped by computer or robot.

`scene` computes geometry and texts, `painting` renders them, `canvas` handles mouse and keys, `card` shows
the selected item, and `words` has the texts.
"""

from app.ui.panels.graph.panel import PANEL as PANEL
