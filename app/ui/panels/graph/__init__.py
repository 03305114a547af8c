"""Graph: who talks to whom, with rates on the lines, grouped by computer or robot.

`scene` measures it, `painting` paints it, `canvas` lets a person move in it, `card` tells of what is chosen,
`words` has the words of all.
"""

from app.ui.panels.graph.panel import PANEL as PANEL
