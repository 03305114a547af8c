"""The sheet "Web pages and tablets": who may connect, the QR code, the connected pages, and refusals.

The server itself and its settings are `app.core.network.web_pages`.
"""

from app.ui.shell.dialogs.web_pages.sheet import WebPagesSheet as WebPagesSheet
