"""Alarms: rules as sentences whose words are chosen, how each is now, and what happened.

`phrases` makes the sentences and takes what is typed, `slots` are their words and `row` an alarm; `columns`
say how alarms are and have the table of what happened.
"""

from app.ui.panels.alarms.panel import PANEL as PANEL
