"""The pictures of the README: drive the real window at 1440 x 900 and write docs/images/*.png.

    python3 dev.py screenshots [FOLDER]

They show the behaviour of the design's pictures on the virtual robot, and one robot that is not connected.
Studio has settings of its own meanwhile. A screen is needed; dev.py makes a virtual one.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import QTimer

from app.core.session import Session
from app.ui.application import Options, make_application, make_window
from app.ui.self_drive import SelfDrive, Step
from app.ui.shell.dialogs.command_palette import Palette
from app.ui.shell.main_window import MainWindow
from nep.masters.master import is_running
from tools.small_png import shrink

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs" / "images"
EXAMPLE = ROOT / "resources" / "examples" / "1-greeting.nepb"
PORTS = range(7780, 7800)
TURN, TOUCH = "turn", "touch"  # the blocks that glow in the pictures
NUMBERS = itertools.count(1)  # blocks without an id are given one, which is an edit
Block = dict[str, object]


# ---- the behaviour ----------------------------------------------------------------------------------


def block(kind: str, *, id: str = "", **given: object) -> Block:
    """A block, as the editor writes it; of what is given texts are fields, the rest is put into its gaps."""
    made: Block = {"type": kind, "id": id or f"picture-{next(NUMBERS)}"}
    fields = {name: value for name, value in given.items() if isinstance(value, str)}
    inputs = {name: value for name, value in given.items() if not isinstance(value, str)}
    if fields:
        made["fields"] = fields
    return {**made, "inputs": inputs} if inputs else made


def number(value: float) -> Block:
    """A number in a gap."""
    return {
        "shadow": {"type": "values_number", "id": f"picture-{next(NUMBERS)}", "fields": {"NUMBER": value}}
    }


def text(value: str) -> Block:
    """A text in a gap."""
    return {"shadow": {"type": "values_text", "id": f"picture-{next(NUMBERS)}", "fields": {"TEXT": value}}}


def pepper(what: str, *, id: str = "", **given: object) -> Block:
    """A block of the virtual robot."""
    return block(f"robot_pepper_{what}", id=id, ROBOT="Pepper", **given)


def chain(first: Block, *others: Block) -> Block:
    """Blocks below each other."""
    last: Block | None = None
    for each in reversed((first, *others)):
        last = {**each, **({"next": {"block": last}} if last else {})}
    return last or first


def scripts() -> list[Block]:
    """The three scripts of the design's picture 02."""
    loop = chain(
        pepper("do_turn", id=TURN, DIRECTION="left", ANGLE=number(30)),
        pepper("do_say", id=TOUCH, TEXT=text("Touch my head.")),
        block("control_wait", SECONDS=number(2)),
    )
    main = chain(
        block("events_started"),
        pepper("do_light", WHERE="eyes", COLOUR="#37b6ff"),
        pepper("do_say", TEXT=text("Hello! I am Pepper.")),
        block("control_wait_until", CONDITION={"block": pepper("get_sees_face")}),
        block("control_repeat", TIMES=number(3), BODY={"block": loop}),
        pepper("do_show_emotion", EMOTION="happy", SECONDS=number(4)),
    )
    newest = block("messages_newest", FIELD="name", TOPIC="/Pepper/faces")
    touched = chain(
        pepper("when_touched", PLACE="head"),
        pepper("do_show_emotion", EMOTION="surprised", SECONDS=number(2)),
        pepper("do_say", TEXT={"block": newest}),
        block("robot_nao_do_wave", ROBOT="NAO", HAND="right"),
    )
    low = block("values_compare", A={"block": pepper("get_battery")}, RELATION="<", B=number(20))
    rest = chain(
        pepper("do_say", TEXT=text("I need a rest.")),
        block("messages_publish", VALUE=text("tired"), TOPIC="/blackboard"),
    )
    message = chain(
        block("events_message", TOPIC="/blackboard"),
        block("control_if", CONDITION={"block": low}, BODY={"block": rest}),
    )
    places = ((main, 28, 28), (touched, 462, 28), (message, 462, 300))
    return [{**script, "x": x, "y": y} for script, x, y in places]


def write_behaviour(path: Path) -> None:
    """The behaviour as a file: it knows Pepper, and NAO, which is not there."""
    robots = json.loads(EXAMPLE.read_text("utf-8"))["robots"]
    nao = json.loads(json.dumps(robots["Pepper"]).replace("/Pepper/", "/NAO/"))
    nao["title"] = "NAO"
    nao["rb:robot"] = {**nao["rb:robot"], "model": "nao", "virtual": False}
    content = {
        "format": "nep-behaviour",
        "version": 1,
        "name": "Greeting",
        "workspace": {"blocks": {"languageVersion": 0, "blocks": scripts()}},
        "robots": {**robots, "NAO": nao},
    }
    path.write_text(json.dumps(content, indent=1), encoding="utf-8")


# ---- the pictures -----------------------------------------------------------------------------------


class Pictures(SelfDrive):
    """The stations of the README."""

    def __init__(self, window: MainWindow, folder: Path, behaviour: Path) -> None:
        self._behaviour = behaviour
        super().__init__(window, folder)

    def _plan(self) -> list[Step]:
        run, session = self._commands.run, self._window.session
        return [
            Step("the start page", self._first, self._window.isVisible, picture="start"),
            Step("the virtual robot", self._begin, self._robot_there, 40, settle_s=2.5),
            *self._run_to(TOUCH),
            *self._stop(),
            *self._run_to(TOUCH, "behaviour-light", settle_s=0.5),
            *self._stop("theme.dark", "behaviour-dark"),
            Step("the topics", lambda: run("layout.developer"), lambda: len(session.topics) > 3, 20),
            Step("a message", self._inspect, lambda: True, settle_s=1.0),
            *self._run_to(TURN, "developer-dark", settle_s=0.4),
            *self._stop(),
            Step("the palette", self._find, lambda: True, picture="palette", settle_s=1.0),
            Step("the palette closed", lambda: run("palette.open"), lambda: True),
            Step("light", lambda: run("theme.light"), lambda: True),
            *self._run_to(TURN, "developer-light", settle_s=0.4),
            *self._stop(),
            Step("its actions", self._robots, self._robot_there, picture="robots", settle_s=1.5),
        ]

    def _run_to(self, block: str, picture: str = "", settle_s: float = 0.6) -> list[Step]:
        """Run from the robot's first place until this block runs."""
        runs = self._window.session.runs

        def glows() -> bool:
            return runs.view().state == "running" and block in runs.running_blocks

        return [
            Step("the robot back in its place", self._reset, self._robot_there, settle_s=1.5),
            Step(f"{block} runs", lambda: self._commands.run("run.run"), glows, 30, picture, settle_s),
        ]

    def _stop(self, then: str = "", picture: str = "") -> list[Step]:
        runs = self._window.session.runs
        stop = Step(
            "every robot stopped",
            lambda: self._commands.run("run.stop"),
            lambda: runs.view().state == "proven",
        )
        return (
            [stop, Step(then, lambda: self._commands.run(then), lambda: True, picture=picture)]
            if then
            else [stop]
        )

    def _robot_there(self) -> bool:
        return any(link.state in {"ready", "busy"} for link in self._window.session.fleet.links)

    def _reset(self) -> None:
        self._window.session.fleet.world("Pepper", {"reset": True})

    def _begin(self) -> None:
        self._commands.run("robots.virtual")
        self._commands.files.open(self._behaviour)

    def _find(self) -> None:
        """The palette with what fits "rob"."""
        self._commands.run("palette.open")
        for palette in self._window.findChildren(Palette):
            palette.field.setText("rob")

    def _robots(self) -> None:
        self._reset()
        self._commands.run("layout.behaviour")
        self._commands.run("panel:robots")

    def _inspect(self) -> None:
        self._window.open_topic("/Pepper/camera")
        self._commands.run("inspect:/Pepper/state")


def take(folder: Path) -> int:
    """Take the pictures; 0 when every station was seen."""
    with tempfile.TemporaryDirectory(prefix="nep-screenshots-") as home:
        free = next(port for port in PORTS if not is_running(f"127.0.0.1:{port}", 0.2))
        os.environ.update(NEP_STUDIO_HOME=home, NEP_MASTER=f"127.0.0.1:{free}", NEP_GATEWAY="0")
        behaviour = Path(home) / "Greeting.nepb"
        write_behaviour(behaviour)
        application = make_application()
        application.setQuitOnLastWindowClosed(False)
        window = make_window(Session(), Options(theme="light", self_drive=folder))
        window.on_shut = lambda: QTimer.singleShot(0, application.quit)
        window.show()
        window.begin()
        pictures = Pictures(window, folder, behaviour)
        application.exec()
    for picture in pictures.pictures:
        shrink(picture)
    return 0 if pictures.well else 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Run as a program."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER)
    return take(parser.parse_args(arguments).folder)


if __name__ == "__main__":
    sys.exit(main())
