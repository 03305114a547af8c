"""Form for the allowed origins of pages, and for the robots that pages may move."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLabel, QVBoxLayout, QWidget

from app.core.network.web_pages import WebPages
from app.ui.shell.dialogs.web_pages.access_form import LABEL_WIDTH
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, label, set_role
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.inputs.check_box import CheckBox
from app.ui.widgets.inputs.token_field import Token, TokenField
from app.ui.widgets.labels import IconLabel
from nep.errors import NepError
from nep.i18n import _, format_list

_FIELD_HEIGHT = 31
EXAMPLE_ORIGIN = "http://192.168.1.20:8080"


class OriginField(TokenField):
    """Token field for allowed origins. Invalid text stays in the field and is shown as an error."""

    def __init__(self, theme: Theme, web: WebPages) -> None:
        super().__init__(theme, _("Origins"), EXAMPLE_ORIGIN, _("Add an origin"))
        self._web = web

    def show_origins(self, origins: Sequence[str]) -> None:
        """Set the tokens to the given origins. Text that is being typed is preserved."""
        if [each.entry for each in self.tokens] == [*origins]:
            return
        for token in self.tokens:
            self._delete_token(token)
        for origin in origins:
            self._add_token(Token(self._theme, origin))
        self._arrange()

    def _on_edited(self, text: str) -> None:
        self.set_invalid(is_invalid=False)
        if text.strip() and text[-1] in " ,":
            self._end_typing()
        self.changed.emit()

    def _end_typing(self) -> None:
        rejected = []
        for origin in self.edit.text().replace(",", " ").split():
            try:
                self._web.add_origin(origin)
            except NepError:
                rejected.append(origin)
        self.edit.setText(" ".join(rejected))
        self.show_origins(self._web.origins)
        self.set_invalid(is_invalid=bool(rejected))
        self.editing_finished.emit()

    def _remove(self, token: Token) -> None:
        self._web.set_origins([each.entry for each in self.tokens if each is not token])
        super()._remove(token)


class _ReadOnlyRow(QWidget):
    """Framed row with read-only contents."""

    def __init__(self) -> None:
        super().__init__()
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)


class RobotChoice(QWidget):
    """Check boxes for the robots that pages may move; `changed` is emitted when the user toggles one."""

    changed = Signal()

    def __init__(self, theme: Theme, web: WebPages, robots: Callable[[], tuple[str, ...]]) -> None:
        # `robots` returns the names of connected robots.
        super().__init__()
        self._theme, self._web, self._robots = theme, web, robots
        self.text_label = label("", "body", wrap=True)
        self.icon = IconLabel(theme, "bot")
        self.choose = Button(theme, _("Choose robots"), size="small")
        self.choose.setCheckable(True)
        self.no_robots_label = label(_("No robots are connected."), "small", role="textTertiary", wrap=True)
        self.boxes: dict[str, CheckBox] = {}
        self.list = QWidget()
        self._flow = Flow(self.list, gap=16, row_gap=2)
        self._flow.setContentsMargins(2, 4, 2, 0)
        self._flow.addWidget(self.no_robots_label)
        line = _ReadOnlyRow()
        row = QHBoxLayout(line)
        row.setContentsMargins(10, 2, 3, 2)
        row.setSpacing(8)
        row.addWidget(self.icon)
        row.addWidget(self.text_label, 1)
        row.addWidget(self.choose)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(line)
        column.addWidget(self.list)
        self.list.hide()
        self.choose.clicked.connect(self._open)
        self.show_state()

    def open_list(self) -> None:
        """Show the check boxes and set the focus to the first one."""
        self.choose.setChecked(True)
        self._open(True)

    def show_state(self) -> None:
        """Update the names of the allowed robots, and the check boxes of all connected or allowed robots."""
        names = self._web.robots
        names_text = format_list(list(names)) if names else _("none")
        text = _("Robots that pages can move: {robots}").format(robots=names_text)
        if text != self.text_label.text():
            self.text_label.setText(text)
        role = "warn" if names else "text"
        set_role(self.text_label, role)
        self.icon.set_icon("triangle-alert" if names else "bot", role if names else "textSecondary")
        if self.choose.isChecked():
            self._show_boxes()

    def _open(self, is_open: bool) -> None:
        self.choose.set_label(_("Done") if is_open else _("Choose robots"))
        self.list.setVisible(is_open)
        if is_open:
            self._show_boxes()
            first = next(iter(self.boxes.values()), None)
            if first is not None:
                first.setFocus()

    def _show_boxes(self) -> None:
        robots = sorted({*self._robots(), *self._web.robots}, key=str.casefold)
        for name in [each for each in self.boxes if each not in robots]:
            box = self.boxes.pop(name)
            self._flow.removeWidget(box)
            box.deleteLater()
        for name in robots:
            if name not in self.boxes:
                box = self.boxes[name] = CheckBox(self._theme, name)
                box.clicked.connect(self._apply)
                self._flow.addWidget(box)
                box.show()
            self.boxes[name].setChecked(name in self._web.robots)
        self.no_robots_label.setVisible(not robots)

    def _apply(self) -> None:
        self._web.set_robots([name for name, box in self.boxes.items() if box.isChecked()])
        self.show_state()
        self.changed.emit()


class PermissionForm(QWidget):
    """Second part of the form: origins and robots, each with an explanation."""

    def __init__(self, theme: Theme, web: WebPages, robots: Callable[[], tuple[str, ...]]) -> None:
        super().__init__()
        self._theme, self._web = theme, web
        self._titles: list[QLabel] = []
        self.origins = OriginField(theme, web)
        self.origins_state = label("", "small", wrap=True)
        self.robots = RobotChoice(theme, web, robots)
        hint = _("Pages can read topics and publish their own. Add a robot's name here to let pages move it.")
        self.robots_state = label(hint, "small", role="textTertiary", wrap=True)
        self._grid = grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(10)
        grid.setVerticalSpacing(5)
        grid.setColumnStretch(1, 1)
        self._add_row(0, label(_("Origins"), "body", role="textSecondary"), self.origins, self.origins_state)
        grid.setRowMinimumHeight(2, 3)
        self._add_row(3, label(_("Robots"), "body", role="textSecondary"), self.robots, self.robots_state)
        self.origins.changed.connect(self.show_state)
        self.origins.editing_finished.connect(self.show_state)
        theme.changed.connect(self._measure)
        self._measure()

    def _add_row(self, row: int, title: QLabel, field: QWidget, hint: QLabel) -> None:
        self._titles = [*self._titles, title]
        self._grid.addWidget(title, row, 0, Qt.AlignmentFlag.AlignTop)
        self._grid.addWidget(field, row, 1)
        self._grid.addWidget(hint, row + 1, 1)

    def _measure(self) -> None:
        self._grid.setColumnMinimumWidth(0, round(self._theme.scaled(LABEL_WIDTH)))
        for title in self._titles:  # aligned with the first line of a field that can grow
            title.setMinimumHeight(round(self._theme.scaled(_FIELD_HEIGHT)))

    def show_state(self) -> None:
        """Update the fields and explanations to the current permissions."""
        self.origins.show_origins(self._web.origins)
        set_role(self.origins_state, "error" if self.origins.is_invalid else "textTertiary")
        self.origins_state.setText(
            _("Enter an origin such as {example}.").format(example=EXAMPLE_ORIGIN)
            if self.origins.is_invalid
            else _("Pages from other origins are blocked. Programs need only the token.")
        )
        self.robots.show_state()
