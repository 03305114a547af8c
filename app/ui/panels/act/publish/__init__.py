"""Publish panel: saved messages that can be edited and sent once or repeatedly.

`shelf_list` contains the list of messages, `message_form` the form of the selected one, and
`value_fields` the fields for the placeholders of a message.
"""

from app.ui.panels.act.publish.panel import PANEL as PANEL
