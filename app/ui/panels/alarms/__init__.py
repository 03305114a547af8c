"""Alarms panel: rules as editable sentences, their states and their history.

`phrases` builds the sentences and parses typed values, `slots` are the editable words, `row` is the widget of
one alarm, and `columns` has the texts of states and the history table.
"""

from app.ui.panels.alarms.panel import PANEL as PANEL
