"""Graph panel: nodes and the topics between them, with rates, grouped by computer or robot.

`scene` computes geometry and hit tests, `painting` paints the scene, and `canvas` handles mouse and keyboard.
`card` shows details of the selected item, `tools` contains the toolbar, and `texts` formats the texts.
"""

from app.ui.panels.watch.graph.panel import PANEL as PANEL
