"""Publish: messages that a person keeps, changes and sends, once or again and again.

`shelf_list` has the list of them, `message_form` the chosen one, `value_fields` what stands in its places.
"""

from app.ui.panels.publish.panel import PANEL as PANEL
