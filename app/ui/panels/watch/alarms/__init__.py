"""Alarms panel: rules as editable sentences, their states and their history.

`phrases` converts rules to sentences and parses typed values. `slots` implements the editable words of
a sentence, `row` the widget of one alarm, and `columns` the texts of states and the history table.
"""

from app.ui.panels.watch.alarms.panel import PANEL as PANEL
