"""Bar above an image for publishing the coordinates of clicks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QLineEdit, QVBoxLayout, QWidget

from app.core.network.topics import split_key
from app.core.run.acting.acting import subscribers_text
from app.core.run.acting.arming import Target
from app.core.run.acting.picture_point import MESSAGE_TYPES, PicturePoint, default_topic
from app.core.run.acting.sending import SendOrder, SendResult
from app.ui.panels.act.armed_strip import ArmedStrip
from app.ui.panels.base import PanelContext
from app.ui.pictures.clicks import KEYBOARD_HINT, ClickablePicture
from app.ui.text import plain
from app.ui.widgets import Button, ComboBox, IconButton, label
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.menus import FieldContextMenu
from nep.errors import BadTopicError
from nep.i18n import _, ngettext
from nep.protocol.wire import check_topic

TOPIC_WIDTH_PX, MAX_TOPIC_LENGTH = 130, 200


class PointStrip(ArmedStrip):
    """Arming strip of a `PointBar`, whose switch also arms the bar's target topic.

    Args:
        arm: Arms the target topic; returns the reason on failure, or "".
        count_text: Returns the summary of the published points, or "".
    """

    def __init__(self, context: PanelContext, arm: Callable[[], str], count_text: Callable[[], str]) -> None:
        self._arm, self._count_text = arm, count_text
        super().__init__(context)

    def disarmed_text(self) -> str:
        return _("Clicks aren't sent until you arm sending")

    def arm(self) -> str:
        return self._arm()

    def summary_text(self) -> str:
        return self._count_text()


class PointBar(QWidget):
    """Bar for publishing the coordinates of clicks in an image.

    Clicks are published while the bar is visible, this panel has armed it, and no recording is open. Only
    the switch and the button of this panel arm the bar, so a restored layout publishes nothing even if its
    topic is armed elsewhere. `exited` is emitted when the user closes the bar.

    Args:
        view: Image view to receive clicks from.
    """

    exited = Signal()

    def __init__(self, context: PanelContext, view: ClickablePicture) -> None:
        super().__init__()
        self._context, self._view, self._acting = context, view, context.session.acting
        self._image_topic = ""
        self.is_on = False
        # armed for this turn of the switch and this target
        self._armed_target: tuple[int, Target] | None = None
        self.sent_count = self.subscriber_count = 0
        theme = context.theme
        self.topic_field = QLineEdit()
        self.topic_field.setAccessibleName(_("Topic for points"))
        self.topic_field.setMaxLength(MAX_TOPIC_LENGTH)
        self.topic_field.setMinimumWidth(round(theme.scaled(TOPIC_WIDTH_PX)))
        self.topic_field.setProperty("focusRadius", theme.radius("control"))
        self.topic_field.textEdited.connect(lambda _text: self._target_changed())
        FieldContextMenu(theme, self.topic_field)
        self.type_choice = ComboBox(theme, [(each, each) for each in MESSAGE_TYPES], name=_("Point type"))
        self.close_button = IconButton(theme, "x", _("Stop publishing points"), size=26)
        self.close_button.clicked.connect(self.exited)
        self.problem_label = label("", "small", role="error", wrap=True)
        self.problem_label.setMinimumWidth(0)
        self.problem_label.setContentsMargins(12, 0, 12, 6)
        self.arm_button = Button(theme, "", "lock", size="small")
        self.arm_button.allow_shrinking()
        self.arm_button.clicked.connect(self._arm_clicked)
        self.strip = PointStrip(context, self.arm, self._count_text)
        self._arrange()
        self.hide()
        self._target_changed()

    def _arrange(self) -> None:
        row = QWidget()
        flow = Flow(row, gap=8, row_gap=4)
        flow.setContentsMargins(12, 6, 6, 6)
        description = label(_("Publish clicked points to"), "small", role="textSecondary")
        description.setToolTip(plain.tip(_(KEYBOARD_HINT)))
        flow.addWidget(description)
        flow.add_elastic(self.topic_field, is_greedy=True)
        for widget in (self.type_choice, self.arm_button, self.close_button):
            flow.addWidget(widget)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        for part in (row, self.problem_label, self.strip):
            column.addWidget(part)

    # -- display ------------------------------------------------------------------------------------------

    @property
    def target(self) -> Target:
        """Topic to which points are published."""
        return Target("topic", self.topic_field.text().strip() or self.topic_field.placeholderText())

    @property
    def is_armed(self) -> bool:
        """True if the next click will be published."""
        arming, target = self._acting.arming, self.target
        return (
            self.is_on
            and self._context.session.shown.is_live
            and self._armed_target == (arming.turn, target)
            and arming.allows(target)
        )

    def refresh(self) -> None:
        """Update the bar. Clicks are accepted only while they can be published."""
        self._view.accepts_clicks = self.is_armed
        if not self.is_on:
            return
        acting = self._acting
        is_waiting = acting.arming.is_on and not self.is_armed and acting.question is None
        self.arm_button.setVisible(
            is_waiting and not self.problem_label.text() and self._context.session.shown.is_live
        )
        self.strip.refresh()

    def set_image_topic(self, key: str) -> None:
        """Set the topic of the images, from which the default target topic is derived.

        Args:
            key: Key of the topic, or "".
        """
        if key != self._image_topic:
            self._image_topic = key
            self._view.discard_click()
            self.topic_field.setPlaceholderText(default_topic(split_key(key)[1]) if key else "")
            self._target_changed()

    def _target_changed(self) -> None:
        # Another target has to be armed again.
        self._disarm()
        self.sent_count = self.subscriber_count = 0
        try:
            check_topic(self.target.name)
            problem = ""
        except BadTopicError as error:
            problem = str(error) if self._image_topic else ""
        self.problem_label.setText(problem)
        self.problem_label.setVisible(bool(problem))
        self.arm_button.set_label(_("Send points"), "lock")
        self.arm_button.setAccessibleName(_("Send the points to {topic}").format(topic=self.target.name))
        self.refresh()

    def _count_text(self) -> str:
        if not self.sent_count:
            return ""
        text = ngettext("{count} point sent", "{count} points sent", self.sent_count).format(
            count=self.sent_count
        )
        return f"{text}, {subscribers_text(self.subscriber_count)}"

    # -- user actions -------------------------------------------------------------------------------------

    def set_active(self, is_on: bool) -> None:
        """Show or hide the bar. A visible bar must be armed before clicks are published."""
        if is_on != self.is_on:
            self.is_on = is_on
            self.setVisible(is_on)
            if not is_on:
                self._disarm()
            self.refresh()

    def arm(self) -> str:
        """Arm the target topic; ask for confirmation if the topic moves a robot.

        Return the reason if arming is not possible, or "".
        """
        if self.problem_label.text():
            return self.problem_label.text()
        arming, target = self._acting.arming, self.target
        error = self._acting.arm() if not arming.is_on else ""
        return error or self._acting.allow(target, partial(self._arming_confirmed, arming.turn, target))

    def _arming_confirmed(self, turn: int, target: Target) -> None:
        if self.is_on and target == self.target:
            self._armed_target = (turn, target)
            self.refresh()

    def _arm_clicked(self) -> None:
        error = self.arm()
        if error:
            self._context.show_toast(error)

    def _disarm(self) -> None:
        # Disarms this panel's target only.
        armed_target, self._armed_target = self._armed_target, None
        arming = self._acting.arming
        if armed_target is None or armed_target[0] != arming.turn:
            return
        if set(arming.targets) <= {armed_target[1]}:
            self._acting.disarm()
        else:
            self._acting.deny(armed_target[1])

    def send(self, point: PicturePoint) -> None:
        """Publish a clicked point."""
        if not self.is_armed:
            return
        payload = point.payload(split_key(self._image_topic)[1], self.type_choice.value)
        name = _("Point ({x}, {y})").format(x=point.x, y=point.y)
        order = SendOrder(
            "image", name, self.target.name, self.type_choice.value, lambda: payload, source=str(payload),
            origin="image", on_result=partial(self._handle_result, point),
        )  # fmt: skip
        error = self._acting.send_order(order)
        if error:
            self._context.show_toast(error)

    def _handle_result(self, point: PicturePoint, result: SendResult) -> None:
        if result.kind != "sent":
            self._context.show_toast(result.message)
        elif result.order.target == self.target:
            self.sent_count, self.subscriber_count = self.sent_count + 1, result.subscriber_count
            self._view.show_mark(point)

    # -- saved state --------------------------------------------------------------------------------------

    def to_json(self) -> dict[str, object]:
        """Return the state for the layout, without the arming."""
        return {"on": self.is_on, "topic": self.topic_field.text().strip(), "type": self.type_choice.value}

    def restore(self, saved: object) -> None:
        """Restore a state returned by `to_json`. Invalid entries are ignored, and nothing is armed."""
        if not isinstance(saved, Mapping):
            return
        topic, kind = saved.get("topic"), saved.get("type")
        if isinstance(topic, str):
            self.topic_field.setText(topic[:MAX_TOPIC_LENGTH])
        if isinstance(kind, str):
            self.type_choice.set_value(kind)
        self._target_changed()
        self.set_active(saved.get("on") is True)

    def dispose(self) -> None:
        """Disarm the bar; called before the panel is closed."""
        self._view.discard_click()
        self._disarm()
