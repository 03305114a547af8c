"""Fuzz targets for files that a person opens in Studio and for messages of robots. They need no Qt."""

from __future__ import annotations

import importlib.util
import tempfile
from collections.abc import Iterator
from pathlib import Path

import msgspec
import orjson

from tests.fuzz.target import Targets, map_of, value_of

TARGETS = Targets()
ROOT = Path(__file__).resolve().parents[2]
IS_THERE = all(importlib.util.find_spec(each) for each in ("platformdirs", "jsonschema"))

if IS_THERE:  # optional: not dependencies of the library
    from app.blocks.model.program import Program
    from app.blocks.model.project import Project
    from app.blocks.model.workspace import parse_workspace
    from app.blocks.runtime.variables import VariableValue
    from app.core.messages.lazy_json import JsonIndex, LazyList, LazyObject
    from app.core.projects.file_format import encode_file, parse_file, write_file
    from app.core.robots.voices import RobotSound
    from app.core.storage.settings import Settings
    from app.errors import DescriptionError, DocumentError
    from app.robots.client import rize
    from app.robots.description.description import parse
    from app.robots.virtual.neighbours import Neighbours

    def behaviours() -> Iterator[bytes]:
        for path in sorted((ROOT / "resources" / "examples").glob("*.nepb"))[:2]:
            yield path.read_bytes()
        workspace = {"blocks": {"blocks": []}}
        yield orjson.dumps({"format": "nep-behaviour", "version": 1, "name": "x", "workspace": workspace})
        greet = {"id": "greet", "name": "Greet", "kind": "goal", "workspace": workspace}
        pages = {"workspace": workspace, "pages": [greet]}
        yield orjson.dumps({"format": "nep-behaviour", "version": 2, "name": "x"} | pages)

    @TARGETS.add(
        DocumentError,
        seeds=behaviours,
        words=(
            b'"format":"nep-behaviour"',
            b'"version":1',
            b'"workspace":',
            b'"blocks":',
            b'"pages":',
            b'"kind":"module"',
            b'"name":',
            b'"robots":',
            b"[[[[",
        ),
        slower=8,
    )
    def files_of_behaviours(data: bytes) -> None:
        made = parse_file(data, Path("a.nepb"))
        assert isinstance(made, Project)
        for page in made.pages:
            parse_workspace(page.workspace.blocks)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "a.nepb"
            write_file(path, made)
            assert encode_file(parse_file(path.read_bytes(), path)) == path.read_bytes()

    def descriptions() -> Iterator[bytes]:
        for path in sorted((ROOT / "resources" / "robots").glob("*.tm.jsonld")):
            yield path.read_bytes()
        yield orjson.dumps({"@type": "tm:ThingModel", "title": "r", "actions": {"go": {"title": "go"}}})

    @TARGETS.add(
        DescriptionError,
        seeds=descriptions,
        words=(b'"actions":', b'"title":', b'"input":', b'"type":"object"', b'"rb:block":', b'"enum":'),
        slower=8,
    )
    def descriptions_of_robots(data: bytes) -> None:
        robot = parse(map_of(data))
        assert robot.name
        for action in robot.actions:
            action.check({})

    @TARGETS.add(
        ValueError,
        seeds=lambda: [b'{"a": [1, "x\\"]", {"b": null}], "c": "\\\\"}', b"[[[]]]"],
        words=(b'\\"', b"{}", b"[,]", b'":'),
        slower=2,
    )
    def large_json(data: bytes) -> None:
        if not data:
            return
        walk(JsonIndex(memoryview(data)).root, 30)

    def walk(value: object, depth: int) -> None:
        if depth and isinstance(value, LazyObject):
            for name in list(value)[:50]:
                walk(value[name], depth - 1)
        elif depth and isinstance(value, LazyList):
            for each in value[:50]:
                walk(each, depth - 1)
        else:
            assert str(value) is not None

    @TARGETS.add(
        seeds=lambda: [b'{"recent": [{"path": "/a", "opened_s": 1, "name": "x"}], "theme": "dark"}'],
        words=(b'"recent":', b'"path":', b'"opened_s":', b"\\u0000", b"1e999"),
        slower=8,
    )
    def files_of_settings(data: bytes) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "settings.json"
            path.write_bytes(data)
            settings = Settings(Path(folder))
            assert isinstance(settings.theme, str)
            assert all(isinstance(each.opened_s, float) for each in settings.all_recent_files)
            settings.theme = "light"
            assert Settings(Path(folder)).theme == "light"

    NEIGHBOUR = {
        "robot": "a",
        "figure": "f",
        "x": 1,
        "y": 0.5,
        "theta_deg": 9,
        "radius": 0.2,
        "height": 1,
        "began_ns": 5,
    }

    @TARGETS.add(
        seeds=lambda: [orjson.dumps(NEIGHBOUR), orjson.dumps({**NEIGHBOUR, "x": None})],
        words=(b'"x":', b'"began_ns":', b"NaN", b"1" * 400),
    )
    def neighbours_of_robots(data: bytes) -> None:
        heard = Neighbours("b", Still(), 1)
        heard.receive(map_of(data))
        for each in heard.present_robots():
            assert each.name
        heard.must_give_way(0.0, 0.0, 0.5)

    class Still:
        """Clock that always returns the same time."""

        def now(self) -> float:
            return 1.0

    DRAWING = {
        "speech": "hi",
        "spoken": 0.5,
        "language": "es",
        "volume": 50,
        "sound": {"number": 1, "played": 0.5, "notes": [[440, 0.5]]},
    }

    @TARGETS.add(
        seeds=lambda: [orjson.dumps(DRAWING)],
        words=(b'"notes":', b'"volume":', b'"sound":', b"NaN", b"1" * 400),
    )
    def voices_of_robots(data: bytes) -> None:
        heard = RobotSound.parse(map_of(data))
        assert 0.0 <= heard.volume <= 1.0 or heard.volume != heard.volume
        assert isinstance(heard.notes, tuple)

    @TARGETS.add(
        seeds=lambda: [b'{"state":"success","id":"1","primitives":[{"primitive":"say"}],"robots":"r"}'],
        words=(b'"state":', b'"primitives":', b'"robots":'),
    )
    def answers_of_rize(data: bytes) -> None:
        value = value_of(data)
        rize.announced_name(value)
        rize.from_reply(value)

    @TARGETS.add(
        KeyError,
        TypeError,
        ValueError,
        seeds=lambda: [orjson.dumps(Program("n", "s", "r", {}).to_json())],
        words=(b'"sensors":', b'"variables":'),
    )
    def programs_for_children(data: bytes) -> None:
        made = Program.from_json(map_of(data))
        assert Program.from_json(made.to_json()) == made

    @TARGETS.add(
        msgspec.DecodeError,
        seeds=lambda: [b'{"id":"a","kind":"list","text":"x","items":["y"],"length":3}'],
        words=(b'"items":', b'"length":'),
    )
    def values_of_children(data: bytes) -> None:
        made = msgspec.json.decode(data, type=VariableValue)
        assert msgspec.json.decode(msgspec.json.encode(made), type=VariableValue) == made
