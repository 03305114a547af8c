"""Strip about the latest rejected request or slow page, with buttons to fix and to dismiss it."""

from __future__ import annotations

from PySide6.QtCore import Signal

from app.core.network.web_texts import WebNotice
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, IconButton, label, paint
from app.ui.widgets.cards import AlertBox
from app.ui.widgets.flow_layout import Flow
from nep.i18n import _, lazy, ngettext

_BUTTON_LABELS = {
    "allow origin": lazy("Allow"),
    "choose robots": lazy("Choose robots"),
    "let in": lazy("Unblock"),
}


class NoticeStrip(AlertBox):
    """Strip that shows one notice.

    `fix_requested` is emitted when the user presses the button that fixes the problem, and `dismissed`
    on close.
    """

    fix_requested = Signal()
    dismissed = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme)
        self.notice: WebNotice | None = None
        self.text_label = label("", "body", wrap=True)
        self.more = label("", "body", role="textSecondary")
        self.button = Button(theme, "", size="small")
        self.close_button = IconButton(theme, "x", _("Dismiss"), size=26)
        line = Flow(gap=8, row_gap=2)
        line.addWidget(self.text_label)
        line.addWidget(self.more)
        self.text_column.addLayout(line)
        self.button_row.addWidget(self.button)
        self.button_row.addWidget(self.close_button)
        self.button.clicked.connect(self.fix_requested)
        self.close_button.clicked.connect(self.dismissed)
        self.hide()

    def show_notices(self, notices: tuple[WebNotice, ...]) -> None:
        """Show the first notice and the number of the others, or hide the strip if there are none."""
        paint.show_when(self, bool(notices))
        if not notices:
            self.notice = None
            return
        notice, others = notices[0], len(notices) - 1
        if notice != self.notice:
            self.notice = notice
            self.set_status(notice.status)
            self.text_label.setText(notice.message)
            self.setAccessibleName(notice.message)
            button_text = _BUTTON_LABELS.get(notice.next_step, "")
            self.button.set_label(_(button_text) if button_text else "")
            paint.show_when(self.button, bool(button_text))
        more = ngettext("and {count} more", "and {count} more", others).format(count=others) if others else ""
        if more != self.more.text():
            self.more.setText(more)
        paint.show_when(self.more, bool(more))
