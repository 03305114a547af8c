"""Services panel: services of the live network, with a form for requests, the reply and earlier calls.

`service_list` contains the list of services, `request_form` the fields of a request, and `reply_view` the
view of a reply.
"""

from app.ui.panels.act.services.panel import PANEL as PANEL
