"""`nep topic hz`, `bw` and `delay`: rate, bandwidth and latency of topics."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from typing import Annotated

import typer

from nep.cli.complete import complete_topic
from nep.cli.network import BackendOption, open_command_node
from nep.cli.options import JsonOption, MasterOption, TimeoutOption
from nep.cli.screen import (
    UNKNOWN,
    display_width,
    format_rate,
    format_size,
    padded,
    print_status,
    show_json,
    write,
)
from nep.cli.topics.rate_window import Bandwidth, Delay, Frequency, LatchedFilter, LatencyWindow, RateWindow
from nep.cli.topics.topic_wait import TopicMonitor
from nep.errors import WaitTimeoutError
from nep.i18n import _, format_list, lazy
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber

_REPORT_PERIOD_S = 1.0
_WAIT_SLICE_S = 0.1
_MIN_TOPIC_WIDTH = 12
_MEAN_COLUMN_WIDTH, _LATENCY_COLUMN_WIDTH = 22, 16
_CLOCK_WARNING_REPORTS = 3
"""Number of reports without a clock comparison after which a warning is printed."""

TopicsArgument = Annotated[
    list[str],
    typer.Argument(
        help=_("Topics to measure."),
        metavar=_("TOPIC"),
        show_default=False,
        autocompletion=complete_topic,
    ),
]
WindowOption = Annotated[
    float,
    typer.Option(
        "--window",
        "-w",
        metavar=_("SECONDS"),
        help=_("Length of the window in seconds."),
        min=1.0,
        max=3600.0,
    ),
]
CountOption = Annotated[
    int, typer.Option("--count", "-n", min=0, metavar="N", help=_("Exit after N reports (0: never)."))
]
Stats = Mapping[str, object]


def hz(
    topics: TopicsArgument,
    window_s: WindowOption = 10.0,
    count: CountOption = 0,
    master: MasterOption = None,
    as_json: JsonOption = False,
    timeout_s: TimeoutOption = None,
    backend: BackendOption = None,
) -> None:
    """Print the rate of topics and the intervals between their messages, once a second until Ctrl+C.

    Intervals are measured with the publishers' time stamps; programs of the original NEP send none, so
    arrival times are used. Latched messages from before the start aren't counted.
    """
    headings = (
        lazy("rate"),
        lazy("shortest"),
        lazy("longest"),
        lazy("std dev"),
        lazy("messages"),
        lazy("lost"),
    )
    _Report(topics, window_s, headings, _frequency_cells).run(
        count, timeout_s, master, backend, as_json=as_json
    )


def bw(
    topics: TopicsArgument,
    window_s: WindowOption = 10.0,
    count: CountOption = 0,
    master: MasterOption = None,
    as_json: JsonOption = False,
    timeout_s: TimeoutOption = None,
    backend: BackendOption = None,
) -> None:
    """Print the bandwidth of topics and the sizes of their messages, once a second until Ctrl+C."""
    headings = (
        lazy("bandwidth"),
        lazy("mean"),
        lazy("smallest"),
        lazy("largest"),
        lazy("messages"),
        lazy("lost"),
    )
    _Report(topics, window_s, headings, _bandwidth_cells).run(
        count, timeout_s, master, backend, as_json=as_json
    )


def delay(
    topics: TopicsArgument,
    window_s: WindowOption = 10.0,
    count: CountOption = 0,
    master: MasterOption = None,
    as_json: JsonOption = False,
    timeout_s: TimeoutOption = None,
    backend: BackendOption = None,
) -> None:
    """Print the latency of messages, once a second until Ctrl+C.

    Between two computers the latency is corrected by the difference of their clocks, which the master
    measures within two seconds; the uncertainty follows after ±. Programs of the original NEP send no time
    stamps, so their latency is unknown. The latency of a latched message is its full age.
    """
    _DelayReport(topics, window_s).run(count, timeout_s, master, backend, as_json=as_json)


class _Report:
    """Table of statistics of one or more topics over a sliding window, printed periodically."""

    def __init__(
        self,
        topics: Sequence[str],
        window_s: float,
        headings: Sequence[str],
        measure: Callable[[RateWindow, float], tuple[Frequency | Bandwidth | Delay | None, Sequence[str]]],
    ) -> None:
        self._windows: Mapping[str, RateWindow] = {topic: RateWindow(window_s) for topic in topics}
        self._headings = headings
        self._measure = measure
        self._subscribers: dict[str, Subscriber] = {}
        self._totals: dict[str, int] = {}
        self._never = threading.Event()
        self._last_received_at = time.monotonic()
        self._width = max(_MIN_TOPIC_WIDTH, *map(display_width, topics))

    def run(
        self,
        count: int,
        timeout_s: float | None,
        master: str | None,
        backend: str | None,
        *,
        as_json: bool,
    ) -> None:
        # Raises `BadTopicError`, `WaitTimeoutError`.
        with ExitStack() as stack, open_command_node("measure", master, backend) as node:
            monitor = TopicMonitor(node, list(self._windows))
            monitor.update(node.graph())
            for topic in self._windows:
                subscription = self._subscribe(node, topic, monitor.msg_type(topic))
                self._subscribers[topic] = stack.enter_context(subscription)
            if not as_json:
                print_status(_("measuring; press Ctrl+C to stop"))
                write(f"{self._format_line(_('topic'), [_(heading) for heading in self._headings])}\n")
            started = time.monotonic()
            for number in itertools.count(1):
                while (remaining_s := started + number * _REPORT_PERIOD_S - time.monotonic()) > 0:
                    self._wait(node, min(remaining_s, _WAIT_SLICE_S))
                for topic in self._windows:
                    (self._show_json if as_json else self._show)(topic)
                if number == count:
                    return
                self._check_silence(monitor, timeout_s)

    def _wait(self, node: Node, seconds: float) -> None:  # noqa: ARG002 - the sink runs in the node's thread
        self._never.wait(seconds)

    def _check_silence(self, monitor: TopicMonitor, timeout_s: float | None) -> None:
        # Reports topics without publishers. Raises `WaitTimeoutError` if no topic received a message in time.
        totals = {topic: window.total for topic, window in self._windows.items()}
        received = {topic for topic, total in totals.items() if total != self._totals.get(topic, 0)}
        now = time.monotonic()
        if received:
            self._totals, self._last_received_at = totals, now
            monitor.mark_received(received)
        if timeout_s is not None and now - self._last_received_at >= timeout_s:
            names = format_list([repr(topic) for topic in totals], "or")
            raise WaitTimeoutError(_("a message on {names}").format(names=names), timeout_s)
        if len(received) < len(totals):
            monitor.poll()

    def _subscribe(self, node: Node, topic: str, msg_type: str) -> Subscriber:
        window, latched_filter = self._windows[topic], LatchedFilter(time.monotonic())

        def on_messages(messages: Sequence[Message]) -> None:
            now = time.monotonic()
            for message in messages:
                if latched_filter.predates_subscription(message, now):
                    continue
                stamp_s = None if message.stamp_ns is None else message.stamp_ns / 1e9
                window.add(now, stamp_s, message.size_bytes)

        return node.new_sub(topic, msg_type, sink=on_messages)

    def _show(self, topic: str) -> None:
        measured, cells = self._measure(self._windows[topic], time.monotonic())
        lost = self._subscribers[topic].lost
        message_count = str(measured.messages) if measured else "0"
        write(
            f"{self._format_line(topic, (*cells, message_count, UNKNOWN if lost is None else str(lost)))}\n"
        )

    def _show_json(self, topic: str) -> None:
        measured, _ = self._measure(self._windows[topic], time.monotonic())
        window = self._windows[topic]
        stats: Stats = asdict(measured) if measured else {"messages": 0}
        lost = self._subscribers[topic].lost
        show_json({"topic": topic, "stamp_ns": time.time_ns(), **stats, "total": window.total, "lost": lost})

    def _format_line(self, topic: str, cells: Sequence[str]) -> str:
        return padded(topic, self._width) + "".join(cell.rjust(12) for cell in cells)


class _DelayReport(_Report):
    """Periodic table of latencies.

    Receives messages in callbacks, because a sink would add up to 5 ms to the measured latency.
    """

    def __init__(self, topics: Sequence[str], window_s: float) -> None:
        headings = (
            lazy("mean"),
            lazy("min"),
            lazy("max"),
            lazy("std dev"),
            lazy("messages"),
            lazy("lost"),
        )
        super().__init__(topics, window_s, headings, self._delay_cells)
        self._latency_windows = {topic: LatencyWindow(window_s) for topic in topics}
        self._windows = self._latency_windows
        self._topics_without_stamp: set[str] = set()
        self._uncompared_reports: dict[str, int] = {}
        """Number of reports by topic while the publisher's clock has not been compared."""

    def _subscribe(self, node: Node, topic: str, msg_type: str) -> Subscriber:
        window = self._latency_windows[topic]

        def on_message(message: Message) -> None:
            latency_s, uncertainty_s = message.latency_s, message.latency_uncertainty_s
            window.add_latency(time.monotonic(), latency_s, message.size_bytes, uncertainty_s)
            if latency_s is None and topic not in self._topics_without_stamp:
                self._topics_without_stamp.add(topic)
                print_status(
                    _("messages of '{topic}' have no time stamp; their latency is unknown").format(
                        topic=topic
                    )
                )

        return node.new_callback(topic, msg_type, on_message, with_message=True)

    def _wait(self, node: Node, seconds: float) -> None:
        node.spin(seconds)

    def _delay_cells(self, window: RateWindow, now: float) -> tuple[Delay | None, Sequence[str]]:
        latency = window.delay(now) if isinstance(window, LatencyWindow) else None
        if latency is None:
            return None, (UNKNOWN,) * 4
        uncertainty_s = latency.uncertainty_s
        latencies = [
            format_latency(each, uncertainty_s) for each in (latency.mean_s, latency.min_s, latency.max_s)
        ]
        if uncertainty_s and latency.mean_s >= 0:
            latencies[0] += f" ± {format_duration(uncertainty_s)}"
        return latency, (*latencies, format_duration(latency.std_s))

    def _format_line(self, topic: str, cells: Sequence[str]) -> str:
        padded_cells = [
            cells[0].rjust(_MEAN_COLUMN_WIDTH),
            *(each.rjust(_LATENCY_COLUMN_WIDTH) for each in cells[1:3]),
        ]
        return super()._format_line(topic, (*padded_cells, *cells[3:]))

    def _show(self, topic: str) -> None:
        super()._show(topic)
        latency = self._latency_windows[topic].delay(time.monotonic())
        is_compared = latency is None or latency.uncertainty_s is not None
        if is_compared:
            self._uncompared_reports.pop(topic, None)
            return
        self._uncompared_reports[topic] = self._uncompared_reports.get(topic, 0) + 1
        if self._uncompared_reports[topic] == _CLOCK_WARNING_REPORTS:
            message = _(
                "'{topic}': the clock difference between the two computers is unknown and is included in "
                "the latency"
            )
            print_status(message.format(topic=topic))


def _frequency_cells(window: RateWindow, now: float) -> tuple[Frequency | None, Sequence[str]]:
    frequency = window.frequency(now)
    if frequency is None:
        return None, (UNKNOWN,) * 4
    return frequency, (
        format_rate(frequency.rate_hz),
        *(format_duration(each) for each in (frequency.min_s, frequency.max_s, frequency.std_s)),
    )


def _bandwidth_cells(window: RateWindow, now: float) -> tuple[Bandwidth | None, Sequence[str]]:
    bandwidth = window.bandwidth(now)
    if bandwidth is None:
        return None, (UNKNOWN,) * 4
    sizes = (format_size(each) for each in (bandwidth.mean_bytes, bandwidth.min_bytes, bandwidth.max_bytes))
    return bandwidth, (format_size(bandwidth.bandwidth_Bps, "/s"), *sizes)


def format_latency(seconds: float, uncertainty_s: float | None) -> str:
    """Format a latency. A negative latency within the clock uncertainty is shown as an upper bound."""
    if uncertainty_s and -uncertainty_s <= seconds < 0:
        return _("under {gap}").format(gap=format_duration(uncertainty_s))
    return format_duration(seconds)


def format_duration(seconds: float) -> str:
    """Format a duration with three significant digits."""
    if seconds < 0:
        return f"-{format_duration(-seconds)}"
    if seconds >= 1:
        return f"{seconds:.3g} s"
    if seconds >= 1e-3:
        return f"{seconds * 1e3:.3g} ms"
    return f"{seconds * 1e6:.3g} us"
