"""Test that a replay gives panels the same bytes as the live messages."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from PySide6.QtCore import QModelIndex, Qt

from app.core.session import Session
from app.core.storage.settings import Settings
from app.ui.intents import OpenRecording
from app.ui.panels.base import Panel, PanelWidget
from app.ui.panels.home import RowHome
from app.ui.panels.registry import PanelRegistry
from app.ui.panels.watch.console.panel import ConsolePanel
from app.ui.panels.watch.image.panel import ImagePanel
from app.ui.panels.watch.inspector.panel import InspectorPanel
from app.ui.panels.watch.plot.panel import PlotPanel
from app.ui.panels.watch.topics.panel import TopicsPanel
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from nep.messages.message import Message
from nep.nodes.log_handler import LOG_TOPIC, LOG_TYPE
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, TopicInfo
from nep.recordings.reader import Recording
from nep.recordings.writer import RecordingWriter
from tests.blocks.fakes import until
from tests.nep.recordings.messages import START_NS, STEP_NS, TestClock, limits, picture
from tests.ui.fakes.network import Network

pytest_plugins = ["tests.ui.shell_fixtures"]

ODD, NUMBERS, WORDS, BYTES, CAMERA = "/odd", "/numbers", "/words", "/bytes", "/camera"
INSPECTED = (ODD, NUMBERS, WORDS, BYTES)
HOME = (RowHome("behaviour", 0, 0, 626),)
BLOCKS = Panel(
    "behaviour", "Behaviour", "blocks", (), lambda context: PanelWidget(context, "Behaviour"), home=HOME
)
ROUNDS = 6
VALUES = (
    0,
    -1,
    2**64 - 1,
    -(2**63),
    1e308,
    5e-324,
    -0.0,
    0.1,
    math.nan,
    math.inf,
    True,
    None,
    "",
    "¿qué? \u202e\x00\t\U0001f916",
    [],
    {},
    [[1, [2, {"a": None}]], "x" * 300],
)


def messages() -> list[Message]:
    """Return messages of every displayed kind, with extreme numbers and characters."""
    chance, made = random.Random(20), []

    def add(topic: str, data: bytes, codec: str, msg_type: str = "") -> None:
        seq = len(made) + 1
        stamp_ns = START_NS + STEP_NS * seq
        made.append(Message(topic, data, codec, msg_type or codec, stamp_ns=stamp_ns, seq=seq, publisher=7))

    for n in range(ROUNDS):
        value = {f"key {k}": chance.choice(VALUES) for k in range(6)}
        value["ñ.[0]"] = VALUES[n]
        add(ODD, json.dumps(value, ensure_ascii=n % 2 == 0).encode(), "json")
        add(NUMBERS, json.dumps({"x": VALUES[n], "y": math.sin(n)}).encode(), "json")
        add(WORDS, ("", "one\nline", "\ufeffé\x07", "ß" * 400, "{}", "last")[n].encode(), "string")
        add(BYTES, chance.randbytes((0, 1, 15, 16, 17, 3000)[n]), "bytes")
        said = {
            "level": ("info", "warn", "error")[n % 3],
            "node": "n",
            "text": f"line {n}\t¿",
            "stamp": 1.5e9 + n,
        }
        add(LOG_TOPIC, json.dumps(said).encode(), "json", LOG_TYPE)
        shown = picture(n, ("jpeg", "png", "raw")[n % 3], CAMERA)
        made.append(
            Message(
                CAMERA,
                bytes(shown.data),
                "image",
                "image",
                stamp_ns=START_NS + STEP_NS * (len(made) + 1),
                seq=len(made) + 1,
                publisher=9,
                extension=dict(shown.extension),
            )
        )
    return made


def view() -> GraphView:
    sender = (PublisherInfo(1, "n1", (), False, 1, 1, 1, 1, 15.0, 1.0),)
    kinds = {ODD: "json", NUMBERS: "json", WORDS: "string", BYTES: "bytes", CAMERA: "image"}
    topics = {name: TopicInfo(name, codec, codec, sender) for name, codec in kinds.items()}
    return GraphView(1, 1, {"n1": NodeInfo("n1", "robot", "there", 5, "python", "native", 0)}, topics)


class Studio:
    """Main window with the real Topics, Inspector, Image, Plot and Console panels."""

    def __init__(self, qtbot, theme: Theme, home: Path) -> None:
        self.qtbot = qtbot
        self.session = Session(
            Settings(home),
            address="127.0.0.1:1",
            source=Network,
            journal_folder=home / "journal",
            start_processes=False,
        )
        assert isinstance(self.session.live.source, Network)
        self.source = self.session.live.source
        self.source.tell(view())
        self.window = MainWindow(self.session, theme, {**PanelRegistry(), "behaviour": BLOCKS}, [])
        qtbot.addWidget(self.window)
        theme.apply()
        self.window.resize(1440, 900)
        self.window.show()
        self.window.show_layout("developer")
        self.window.tick()
        for topic in INSPECTED:
            self.session.live.watch(topic)
        self.session.live.watch(LOG_TOPIC)
        self.panel("image", ImagePanel).show_topic(CAMERA)
        self.panel("plot", PlotPanel).plot_field(NUMBERS, "x")
        self.panel("plot", PlotPanel).plot_field(NUMBERS, "y")
        for name in ("image", "plot"):  # hidden behind a tab, they would watch no topics
            self.window.bench.docks[name].setFloating(True)
        docks = self.window.bench.docks
        self.until(lambda: docks["image"].is_displayed() and docks["plot"].is_displayed())
        self.until(lambda: self.source.wanted >= {*INSPECTED, CAMERA, LOG_TOPIC})

    def panel(self, name: str, kind: type) -> PanelWidget:
        bench = self.window.bench
        assert bench is not None
        dock = bench.open(name)
        assert dock is not None
        assert isinstance(dock.panel, kind)
        return dock.panel

    def until(self, true: Callable[[], object]) -> None:
        def tick() -> bool:
            self.window.tick()
            return bool(true())

        self.qtbot.waitUntil(tick, timeout=60_000)

    def holds(self, came: list[Message]) -> dict[str, object]:
        """Wait until the panels have processed the messages and return the panels' contents."""
        held: dict[str, object] = {}
        newest = {message.topic: message for message in came}
        inspector = self.panel("inspector", InspectorPanel)
        for topic in INSPECTED:
            if topic not in newest:
                continue
            inspector.show_topic(topic)
            self.until(
                lambda seq=newest[topic].seq: (
                    inspector.inspected.message and inspector.inspected.message.seq == seq
                )
            )
            inspector.mode.set_value("raw")
            self.window.tick()
            inspector.bytes.show_bytes(inspector.inspected.message.data)
            held[f"{topic} in hex"] = (bytes(inspector.inspected.message.data), inspector.bytes.text())
            inspector.mode.set_value("tree")
            self.window.tick()
            held[f"{topic} as a tree"] = rows(inspector.model, QModelIndex())
        if CAMERA in newest:
            shown = self.panel("image", ImagePanel).view
            self.until(lambda: shown.picture and shown.picture.message.seq == newest[CAMERA].seq)
            held["picture"] = (shown.picture.width, shown.picture.height, shown.picture.bgra.tobytes())
        console = self.panel("console", ConsolePanel)
        self.window.tick()
        held["lines"] = [(r.stamp_s, r.level, r.origin, r.text) for r in self.session.shown.console.records]
        held["lines in sight"] = [
            console.model.index(n, 0).data(Qt.ItemDataRole.AccessibleTextRole)
            for n in range(console.model.rowCount())
        ]
        plot = self.panel("plot", PlotPanel)
        origin_ns = self.session.shown.series.origin_ns
        for curve in plot.shown:
            samples = curve.curve.samples
            stamps = [round((origin_ns + each * 1e9) / 1000) for each in samples.times.tolist()]
            held[f"curve {curve.name}"] = (stamps, samples.values.tobytes(), samples.gaps.tolist())
        table = self.panel("topics", TopicsPanel).model
        self.until(lambda: table.rowCount() >= len(newest) - (LOG_TOPIC in newest))
        listed = {table.index(n, 0).data(): table.index(n, 1).data() for n in range(table.rowCount())}
        held["topics"] = {name: listed.get(name) for name in newest if name != LOG_TOPIC}
        return held


def rows(model, parent: QModelIndex) -> list[object]:
    """Return the texts of all rows with their child rows."""
    found = []
    for row in range(model.rowCount(parent)):
        index = model.index(row, 0, parent)
        words = [model.index(row, column, parent).data() for column in range(model.columnCount(parent))]
        found.append((words, rows(model, index)))
    return found


@pytest.fixture
def studio(qtbot, theme: Theme, home: Path) -> Iterator[Studio]:
    made = Studio(qtbot, theme, home)
    yield made
    made.window.close()


def test_panels_show_identical_bytes_live_and_in_replay(studio: Studio, tmp_path: Path) -> None:
    path, sent = tmp_path / "Tour.mcap", messages()
    last = len(sent) - 1
    places = [*random.Random(4).sample(range(last), 5), last]
    live: dict[int, dict[str, object]] = {}
    with RecordingWriter(path, clock=TestClock(), limits=limits()) as writer:
        for number, message in enumerate(sent):
            studio.source.send(message)
            writer.post([message])
            assert writer.flush()
            if number in places:
                live[number] = studio.holds(sent[: number + 1])
    assert len(live[last]["lines"]) == len(live[last]["lines in sight"]) == ROUNDS
    curves = [held for what, held in live[last].items() if what.startswith("curve ")]
    assert [len(stamps) for stamps, _values, _gaps in curves] == [ROUNDS, ROUNDS]
    with Recording(path) as recording:
        times = [log_ns for log_ns, _message in recording.read()]
    assert len(times) == len(sent)
    studio.window.commands.request(OpenRecording(path))
    replay = studio.session.replay
    assert replay is not None
    studio.until(lambda: replay.opened_recording is not None)

    def compare(place: int) -> None:
        held: dict[str, object] = {}

        def is_same() -> bool:
            held.update(studio.holds(sent[: place + 1]))
            return held == live[place]

        with suppress(AssertionError):  # the differences are told below
            until(is_same)  # curves and lines may come after the message
        assert held.keys() == live[place].keys()
        for what, was in live[place].items():
            assert held[what] == was, (place, what)

    for place in (*places, places[0]):
        replay.seek(times[place])
        studio.until(lambda at_ns=times[place]: replay.player.position_ns == at_ns)
        compare(place)
    replay.seek(times[0])
    replay.play()
    studio.until(lambda: replay.player.is_at_end)
    compare(last)
