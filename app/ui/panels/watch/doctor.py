"""Connection doctor panel: reasons why messages of a topic, or of any topic, don't arrive, with next steps.

`app.core.network.doctor` checks the network in the background. Causes within Studio itself, such as an open
recording or a paused panel, are checked on every refresh.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from PySide6.QtGui import QAction, QGuiApplication
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout

from app.core.network.topics import split_key
from app.core.networks.networks import lost_message, topic_label
from app.core.reports import not_installed
from app.intents import AllowOtherComputers, BrowseNetworks, Inspect, Intent, OpenDoctor
from app.ui.intents import OpenPanel, SelectService
from app.ui.panels.base import Blocker, Diagnose, Panel, PanelContext, PanelWidget
from app.ui.panels.command import Command, IntentHandler
from app.ui.panels.home import TabHome
from app.ui.widgets import Button, Chip, ElidedLabel, EmptyState, IconButton, Separator, label
from app.ui.widgets.cards import AlertRow
from app.ui.widgets.inputs.combo_box import ComboBox
from app.ui.widgets.lists.scroll_areas import PanelRows
from nep.errors import nearest
from nep.i18n import _, lazy, ngettext, number
from nep.programs.doctor import Finding, report_text, sort_findings

STATUS_BY_SEVERITY = {"error": "error", "warning": "warn", "info": "info", "ok": "ok"}
PROBLEM_SEVERITIES = frozenset({"error", "warning"})
WAIT_REPORT_DELAY_S = 2.0
"""Time in s that a panel waits for messages before the doctor reports it."""
MAX_TOPICS = 500
"""Maximum number of topics to choose from, and to search for a similar name."""


@dataclass(frozen=True, slots=True)
class NextStep:
    """Button of a finding.

    Attributes:
        text: Text of the button.
        run: Called when the button is clicked.
    """

    text: str
    run: Callable[[], object]
    is_fix: bool = True
    """True if the step fixes the problem; the doctor then runs its checks again."""


class DoctorPanel(PanelWidget):
    """Panel with a field for the topic whose messages are missing, and the findings, most severe first."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Connection doctor"))
        self._last_state: tuple[object, ...] = ()
        self._last_topic_state: tuple[object, ...] = ()
        self._master = ""
        self._stalled_panel: PanelWidget | None = None
        self._shown_blockers: list[Blocker] = []
        self._wait_starts_s: dict[tuple[PanelWidget, str], float] = {}  # start of waiting, by panel and topic
        self._suggestions: dict[str, str | None] = {}
        self._shown_texts: tuple[object, ...] = ()
        self.rows: list[AlertRow] = []
        self.shown_findings: list[Finding] = []  # parallel to `rows`
        self.chip = Chip(self.theme)
        self.chips = [self.chip]
        self.check_button = IconButton(self.theme, "refresh-cw", _("Check again"), size=26)
        self.check_button.clicked.connect(self.session.doctor.start)
        self.header = [self.check_button]
        self._copy_action = QAction(_("Copy the report"), self)
        self._copy_action.triggered.connect(self.copy_report)
        self.empty = EmptyState(
            self.theme, "stethoscope", _("Checking connections"), _("This takes a second or two.")
        )
        self.pages = PanelRows(self.empty, _("Connection doctor"))
        self.topic_choice = ComboBox(self.theme, name=_("Missing topic"))
        self.topic_choice.activated.connect(self._set_expected_topic)
        self._arrange()

    def _arrange(self) -> None:
        choice_label = label(_("Missing topic"), "body", role="textSecondary")
        choice_label.setBuddy(self.topic_choice)
        self.progress_label = ElidedLabel("small", "textTertiary", min_width=40)
        top = QHBoxLayout()
        top.setContentsMargins(12, 8, 12, 4)
        top.setSpacing(8)
        top.addWidget(choice_label)
        top.addWidget(self.topic_choice, 1)
        top.addWidget(self.progress_label, 1)
        self.command_label = ElidedLabel("small", "textSecondary", min_width=40)
        self.copy_button = Button(self.theme, _("Copy the report"), "copy", size="small")
        self.copy_button.allow_shrinking()
        self.copy_button.clicked.connect(self.copy_report)
        footer = QHBoxLayout()
        footer.setContentsMargins(12, 5, 12, 6)
        footer.setSpacing(8)
        footer.addWidget(self.command_label, 1)
        footer.addWidget(self.copy_button)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addLayout(top)
        column.addWidget(self.pages, 1)
        column.addWidget(Separator(self.theme))
        column.addLayout(footer)

    # -- display ------------------------------------------------------------------------------------------

    def diagnose(self, panel: PanelWidget | None = None, topic: str = "") -> None:
        """Run the connection doctor.

        Args:
            panel: Panel that shows no new data; None for no panel.
            topic: Topic to check first; "" for any topic.
        """
        self.session.doctor.expect_topic(topic)
        self.set_stalled_panel(panel)

    def set_stalled_panel(self, panel: PanelWidget | None) -> None:
        """Report findings about a panel too. The topic of the doctor must be set before.

        Args:
            panel: Panel that shows no new data; None for no panel.
        """
        if self._stalled_panel is not None:
            self._stalled_panel.destroyed.disconnect(self._clear_stalled_panel)
        self._stalled_panel = panel
        if panel is not None:
            panel.destroyed.connect(self._clear_stalled_panel)
        self.refresh()

    def _clear_stalled_panel(self) -> None:
        self._stalled_panel = None

    def refresh(self) -> None:
        doctor = self.session.doctor
        if self.session.live.master.kind != self._master:
            # the master changed while the panel is open: earlier findings are outdated
            self._master = self.session.live.master.kind
            doctor.start()
        elif doctor.checked_topic != doctor.expected_topic and not doctor.is_running:
            doctor.start()
        self._update_topics()
        blockers = list(self._blockers())
        texts = tuple((each.message, each.button) for each in blockers)
        state = (doctor.revision, doctor.is_running, texts)
        if state == self._last_state:
            return
        self._last_state = state
        self.check_button.setEnabled(not doctor.is_running)
        partial_findings = doctor.partial_findings
        is_new = doctor.finished_s is None or doctor.checked_topic != doctor.expected_topic
        if partial_findings is None and doctor.finished_s is None:
            return
        self._shown_blockers = blockers  # earlier findings stay visible until the next check is done
        findings = self._merge_findings(
            blockers, partial_findings if partial_findings is not None and is_new else doctor.findings
        )
        if findings != self.shown_findings or texts != self._shown_texts:
            self._shown_texts = texts
            self._show(findings)
        if doctor.finished_s is not None:
            self.set_title(self.title(), time.strftime("%H:%M", time.localtime(doctor.finished_s)))
        self._show_chip(is_done=partial_findings is None)
        self._update_progress(is_done=partial_findings is None)
        self.pages.show_rows(bool(self.rows))

    @staticmethod
    def _merge_findings(blockers: Sequence[Blocker], findings: Sequence[Finding]) -> list[Finding]:
        own_findings = [
            Finding(f"studio:{index}", "error", each.message, each.fix) for index, each in enumerate(blockers)
        ]
        return list(sort_findings([*own_findings, *findings]))

    def _blockers(self) -> Iterator[Blocker]:
        session, topic = self.session, self.session.doctor.expected_topic
        libraries = session.alerts.get(not_installed.ALERT_ID)
        if libraries is not None:
            yield Blocker(libraries.title, libraries.detail, "", lambda: None)
        if session.replay is not None and (topic or self._stalled_panel is not None):
            yield self._replay_blocker(topic)
        network = session.live.networks.get(split_key(topic)[0])
        if network is not None:
            yield from self._network_blockers(topic, lost_message(network))
        if self._stalled_panel is not None:
            yield from self._stalled_panel.blockers()
        yield from self._waiting_blockers()

    def _waiting_blockers(self) -> Iterator[Blocker]:
        # Without the missing topic, which the other findings are about.
        expected_topic, now = self.session.doctor.expected_topic, time.monotonic()
        panels = self.context.panels() if self.world.is_live else ()
        waiting = {
            (panel, topic) for panel in panels if (topic := panel.awaited_topic()) and topic != expected_topic
        }
        self._wait_starts_s = {each: self._wait_starts_s.get(each, now) for each in waiting}
        for panel, topic in sorted(waiting, key=lambda each: (each[0].title(), each[1])):
            if now - self._wait_starts_s[panel, topic] >= WAIT_REPORT_DELAY_S:
                yield self._waiting_blocker(panel, topic)

    def _waiting_blocker(self, panel: PanelWidget, topic: str) -> Blocker:
        live, names = self.session.live, {"panel": panel.title(), "topic": topic_label(topic)}
        doctor_button = (_("Why is nothing shown?"), lambda: self.context.open_doctor(panel, topic))
        topic_info = live.topics.get(topic)
        if split_key(topic)[0] or (topic_info is not None and topic_info.publisher_nodes):
            return Blocker(
                _("{panel} is waiting for {topic}; no message has arrived.").format(**names),
                "",
                *doctor_button,
            )
        message = _("{panel} is waiting for {topic}, which has no publisher.").format(**names)
        if topic not in self._suggestions:  # cached: comparing thousands of names takes long
            sent = [each.key for each in live.topics if each.publisher_nodes]
            self._suggestions = {topic: nearest(topic, sent[:MAX_TOPICS])}
        suggestion = self._suggestions[topic]
        if suggestion is None:
            return Blocker(message, "", *doctor_button)
        fix_template, button_template = _("Did you mean {topic}?"), _("Use {topic}")
        return Blocker(
            message,
            fix_template.format(topic=suggestion),
            button_template.format(topic=suggestion),
            lambda: panel.show_topic(suggestion),
        )

    def _replay_blocker(self, topic: str) -> Blocker:
        is_recorded = not topic or self.world.topics.get(topic) is not None
        message = _("A recording is open, so panels show recorded data instead of live data.")
        if not is_recorded:
            message = _("The open recording doesn't contain {topic}.").format(topic=topic_label(topic))
        fix = _("The checks below are about the live network.")
        return Blocker(message, fix, _("Back to live"), lambda: self.context.run("replay.live"))

    def _network_blockers(self, topic: str, lost: str) -> Iterator[Blocker]:
        # Topics of another network: the doctor can't check them.
        problem = self.session.live.networks.read_problem(topic)
        message = lost or (f"{topic_label(topic)}: {problem}." if problem else "")
        if message:
            fix = _("Check its address, and its password or key if it needs one.")
            yield Blocker(message, fix, _("Other networks"), lambda: self.context.request(BrowseNetworks()))

    def _update_topics(self) -> None:
        live, expected_topic = self.session.live, self.session.doctor.expected_topic
        state = (live.topics.revision, live.networks.revision, expected_topic)
        if state == self._last_topic_state or self.topic_choice.view().isVisible():
            return
        self._last_topic_state = state
        names = [topic.key for topic in live.all_topics]
        self.topic_choice.clear()
        self.topic_choice.addItem(_("no specific topic"), "")
        for name in sorted({*names[:MAX_TOPICS], expected_topic} - {""}):
            self.topic_choice.addItem(topic_label(name), name)
        self.topic_choice.set_value(expected_topic)
        command = (
            f"nep doctor {expected_topic}"
            if expected_topic and not split_key(expected_topic)[0]
            else "nep doctor"
        )
        self.command_label.setText(_("In a terminal: {command}").format(command=command))

    def _update_progress(self, *, is_done: bool) -> None:
        doctor = self.session.doctor
        checked, count = (number(each, ".0f") for each in (doctor.check_count, doctor.total_checks))
        if not is_done:
            self.progress_label.setText(_("Checking: {done} of {count}").format(done=checked, count=count))
            return
        template = ngettext("{count} check done", "{count} checks done", doctor.check_count)
        if all(each.severity not in PROBLEM_SEVERITIES for each in self.shown_findings):
            template = ngettext("{count} check passed", "All {count} checks passed", doctor.check_count)
        self.progress_label.setText(template.format(count=checked))

    def _show(self, findings: Sequence[Finding]) -> None:
        for row in self.rows:
            self.pages.remove_row(row)
        self.shown_findings = list(findings)
        steps = [self._next_step(finding) for finding in findings]
        fixes = [index for index, step in enumerate(steps) if step is not None and step.is_fix]
        self.rows = [self._create_row(finding, step) for finding, step in zip(findings, steps, strict=True)]
        for index, row in enumerate(self.rows):
            row.button.set_kind("primary" if index in fixes[:1] else "plain")
            self.pages.insert_row(index, row)

    def _show_chip(self, *, is_done: bool) -> None:
        problem_severities = [
            each.severity for each in self.shown_findings if each.severity in PROBLEM_SEVERITIES
        ]
        if problem_severities:
            self.chip.set(str(len(problem_severities)), STATUS_BY_SEVERITY[problem_severities[0]])
        elif is_done:
            self.chip.set(_("no problems"), "ok")
        else:
            self.chip.set("", "info")

    def _create_row(self, finding: Finding, step: NextStep | None) -> AlertRow:
        row = AlertRow(self.theme, is_framed=finding.severity in PROBLEM_SEVERITIES)
        row.set_texts(
            STATUS_BY_SEVERITY[finding.severity],
            finding.sentence,
            finding.fix,
            command=finding.command,
            button=step.text if step is not None else "",
        )
        row.button.clicked.connect(lambda: self._run_step(finding, step))
        return row

    # -- next steps ---------------------------------------------------------------------------------------

    def _next_step(self, finding: Finding) -> NextStep | None:
        kind, _colon, index = finding.id.partition(":")
        if kind == "studio" and not self._shown_blockers[int(index)].button:
            return None
        if kind == "studio":
            return NextStep(self._shown_blockers[int(index)].button, self._shown_blockers[int(index)].run)
        if finding.id == "topic:near":
            text = _("Use {topic}").format(topic=finding.instead)
            return NextStep(text, lambda: self._use_topic(finding.instead))
        if kind == "topic" and finding.instead:
            return NextStep(
                _("Call {service}").format(service=finding.instead),
                lambda: self.context.request(SelectService(finding.instead)),
            )
        buttons: dict[str, tuple[str, Intent]] = {
            "topic:closed": (_("Let other computers connect"), AllowOtherComputers()),
            "topic:unreadable": (_("Show the bytes"), Inspect(self.session.doctor.expected_topic)),
            "topic:name": (_("Choose a topic"), OpenPanel("topics")),
        }
        if finding.id in buttons:
            text, intent = buttons[finding.id]
            is_fix = finding.severity in PROBLEM_SEVERITIES
            return NextStep(text, lambda: self.context.request(intent), is_fix=is_fix)
        if finding.id == "master:none":
            return NextStep(_("Start the master"), self._start_master)
        if finding.command:
            return NextStep(_("Copy the command"), lambda: self._copy_command(finding.command), is_fix=False)
        return None

    def _run_step(self, finding: Finding, step: NextStep | None) -> None:
        if step is None:
            return
        step.run()
        if finding.id.startswith("studio:"):
            self.session.doctor.start()
            self.context.show_toast(_("Done. Checking again"))

    def _use_topic(self, topic: str) -> None:
        if self._stalled_panel is not None:
            self._stalled_panel.show_topic(topic)
        else:
            self.context.open_topic(topic)
        self.session.doctor.expect_topic(topic)
        self.context.show_toast(_("Opened {topic}. Checking again").format(topic=topic))

    def _start_master(self) -> None:
        self.session.launcher.ensure_master()
        self.context.show_toast(_("Starting the master"))

    def _copy_command(self, command: str) -> None:
        QGuiApplication.clipboard().setText(command)
        self.context.show_toast(_("Copied “{command}”").format(command=command))

    def _set_expected_topic(self) -> None:
        self.session.doctor.expect_topic(self.topic_choice.value)
        self.set_stalled_panel(None)

    def copy_report(self) -> None:
        """Copy all findings to the clipboard as a report."""
        expected_topic = self.session.doctor.expected_topic
        heading = (
            _("Missing: {topic}").format(topic=topic_label(expected_topic)) + "\n" if expected_topic else ""
        )
        QGuiApplication.clipboard().setText(heading + report_text(self.shown_findings))
        self.context.show_toast(_("Copied the report"))

    def more_actions(self) -> Sequence[QAction]:
        return (self._copy_action,)


PANEL = Panel(
    "doctor",
    lazy("Connection doctor"),
    "stethoscope",
    (),
    DoctorPanel,
    home=(TabHome("developer", "topics"), TabHome("behaviour", "behaviour")),
    commands=(
        Command(
            "help.doctor",
            lazy("Connection doctor"),
            DoctorPanel.diagnose,
            "Help",
            ("F4",),
            "stethoscope",
            after="help.shortcuts",
        ),
    ),
    intents=(
        IntentHandler(OpenDoctor, lambda panel, _intent: panel.diagnose()),
        IntentHandler(Diagnose, lambda panel, intent: panel.diagnose(intent.panel, intent.topic)),
    ),
)
