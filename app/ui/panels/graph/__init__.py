"""Graph panel: nodes and the topics between them, with rates, grouped by computer or robot.

`scene` computes geometry and texts, `painting` paints them, and `canvas` handles mouse and keyboard.
`card` shows details of the selected item; `words` formats the texts.
"""

from app.ui.panels.graph.panel import PANEL as PANEL
