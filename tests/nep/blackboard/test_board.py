"""Tests of a blackboard without a node, with a fake clock."""

from __future__ import annotations

import gc
import math
import threading
from collections.abc import Callable

import pytest

import nep
from nep.programs.blackboard.keys import key_text, parse_key


class Clock:
    """Fake clock that returns `now` in seconds."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def board(clock: Clock) -> nep.Blackboard:
    return nep.Blackboard(clock=clock)


def test_stored_values_are_read_back(board: nep.Blackboard) -> None:
    board.put("human.1.position", [1, 2, 3])
    board["human.1"] = {"name": "Ada", "face": {"size": 4}}
    assert board["human.1.position"] == [1, 2, 3]
    assert board["human.1"] == {"position": [1, 2, 3], "name": "Ada", "face": {"size": 4}}
    assert board["human"] == {"1": board["human.1"]}
    assert board.get("human.2") is None
    assert board.get("human.2", "nobody") == "nobody"
    assert ("human.1.face" in board, "human.2" in board) == (True, False)
    assert board.keys() == ["human.1.face.size", "human.1.name", "human.1.position"]
    assert len(board) == 3
    with pytest.raises(nep.NoValueError) as raised:
        board["human.1.nam"]
    assert str(raised.value) == "the blackboard has no 'human.1.nam'; did you mean 'human.1.name'?"
    assert isinstance(raised.value, KeyError)


def test_each_key_has_its_own_age(board: nep.Blackboard, clock: Clock) -> None:
    board.put("a.x", 1)
    clock.now += 2
    board.put("a.y", 2)
    clock.now += 3
    assert (board.age_s("a.x"), board.age_s("a.y"), board.age_s("a")) == (5, 3, 3)
    assert board.age_s("b") == math.inf
    assert board.get("a.x", max_age_s=5) == 1
    assert board.get("a.x", "old", max_age_s=4.9) == "old"
    assert board.get("a", max_age_s=4) == {"y": 2}, "of a map, what is young enough"
    entry = board.entry("a.x")
    assert entry == nep.BlackboardEntry("a.x", 1, 5, "arrival", "", "", None, math.inf)
    board.put("a.x", 1)
    assert board.age_s("a.x") == 0, "told again it is young again"


def test_clock_set_back_gives_no_negative_age(board: nep.Blackboard, clock: Clock) -> None:
    board.put("a", 1, lives_s=5)
    clock.now -= 100
    assert board.age_s("a") == 0
    board.put("a", 2, lives_s=5)
    assert board["a"] == 2
    clock.now += 5
    assert "a" not in board


@pytest.mark.parametrize(
    "value",
    [
        None,
        True,
        0,
        -1,
        2**64 - 1,
        pytest.param(10**5000, id="5000 digits"),
        1.5,
        "",
        "é\N{ROBOT FACE}",
        [],
        {},
        b"\0",
    ],
)
def test_any_value_type_is_stored_unchanged(board: nep.Blackboard, value: object) -> None:
    board.put("x", value)
    assert board["x"] == value
    assert type(board["x"]) is type(value)


def test_nan_is_stored_and_repeated_nan_is_not_a_change(board: nep.Blackboard) -> None:
    seen: list[nep.BlackboardChange] = []
    board.on_change("x", seen.append)
    for value in (math.nan, float("nan"), math.inf, -math.inf):
        board.put("x", value)
    board.deliver()
    assert [str(each.value) for each in seen] == ["nan", "inf", "-inf"]


def test_stored_and_returned_values_are_copies(board: nep.Blackboard) -> None:
    given = [1, {"a": [2]}]
    board.put("x", given)
    given.append(3)
    board["x"].append(4)  # type: ignore[attr-defined]
    board["x"][1]["a"].append(5)  # type: ignore[index]
    assert board["x"] == [1, {"a": [2]}]
    board.snapshot()["x"].value.append(6)  # type: ignore[attr-defined]
    assert board.get("x") == [1, {"a": [2]}]


def test_value_can_be_replaced_by_a_map_and_back(board: nep.Blackboard) -> None:
    seen: list[tuple[str, str]] = []
    board.on_change("**", lambda change: seen.append((change.key, change.cause)))
    board.put("a", 1)
    board.put("a", {"b": {"c": 1}, "d": 2})
    assert board["a"] == {"b": {"c": 1}, "d": 2}
    board.put("a.b", "x")
    assert board["a"] == {"b": "x", "d": 2}
    board.put("a", {})
    assert board["a"] == {"b": "x", "d": 2}, "an empty map has nothing new"
    board.put("a", [])
    assert board["a"] == []
    board.deliver()
    assert seen == [
        ("a", "new"),
        ("a", "replaced"),
        ("a.b.c", "new"),
        ("a.d", "new"),
        ("a.b.c", "replaced"),
        ("a.b", "new"),
        ("a.d", "replaced"),
        ("a.b", "replaced"),
        ("a", "new"),
    ]
    assert board.keys() == ["a"]


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("a", ("a",)),
        ("a.b", ("a", "b")),
        (r"file.a\.txt", ("file", "a.txt")),
        (r"a\\.b", ("a\\", "b")),
        (r"\.", (".",)),
        ("a.", ("a", "")),
        (".", ("", "")),
        ("..a", ("", "", "a")),
        ("*", ("*",)),
        ("ключ.鍵.🤖", ("ключ", "鍵", "🤖")),
        ("a b/c[0]{x}", ("a b/c[0]{x}",)),
        ("\x1b[2J\n", ("\x1b[2J\n",)),
    ],
)
def test_key_text_round_trips(board: nep.Blackboard, text: str, names: tuple[str, ...]) -> None:
    assert parse_key(text) == names
    assert parse_key(key_text(names)) == names
    board.put(names, 7)
    assert board[text] == 7
    assert board[names] == 7
    assert board.keys() == [key_text(names)]
    assert board.remove(text) == 1
    assert len(board) == 0
    assert board._entries._tree == {}


@pytest.mark.parametrize(
    ("key", "named"),
    [
        ("", "''"),
        ((), "''"),
        (("",), "''"),
        (5, "'int'"),
        (None, "'NoneType'"),
        (b"a", "'bytes'"),
        (("a", 5), "'tuple'"),
        ("x" * 1001, r"\(1001 characters\)' .*1000"),
        (".".join("a" * 33), r"a\.a' .*32"),
        ("\ud800", r"\\ud800' .*surrogate"),
        (["a"], "'list'"),
    ],
)
def test_invalid_keys_are_rejected(board: nep.Blackboard, key: str, named: str) -> None:
    for use in (board.get, board.age_s, board.remove, lambda each: board.put(each, 1)):
        with pytest.raises(nep.BadKeyError, match=named):
            use(key)
    assert len(board) == 0


def test_keys_are_found_by_pattern(board: nep.Blackboard) -> None:
    for key in ("human.1.position", "human.1.face.size", "human.2.position", "human", "object.1.position"):
        board.put(key, 1)
    assert board.keys() == ["human", "object.1.position"], "a value takes the place of what is below it"
    board.put("human.1.position", 1)
    board.put("human.1.face.size", 1)
    board.put("human.2.position", 1)
    assert board.keys("human.*.position") == ["human.1.position", "human.2.position"]
    assert board.keys("human.**") == ["human.1.face.size", "human.1.position", "human.2.position"]
    assert board.keys("**.position") == ["human.1.position", "human.2.position", "object.1.position"]
    assert board.keys("human.1") == []
    assert board.keys("*") == []
    assert list(board.snapshot("object.**")) == ["object.1.position"]
    assert board.keys("human.1.position.**") == ["human.1.position"]


def test_value_expires_unless_it_is_updated(board: nep.Blackboard, clock: Clock) -> None:
    seen: list[tuple[str, str, object, object]] = []
    board.on_change("**", lambda each: seen.append((each.key, each.cause, each.value, each.entry.value)))
    board.put("touched.head", 1, lives_s=3)
    board.put("name", "Pepper")
    clock.now += 2
    board.put("touched.head", 1, lives_s=3)
    clock.now += 2.9
    assert board.get("touched.head", 0) == 1
    entry = board.entry("touched.head")
    assert entry is not None
    assert entry.left_s == pytest.approx(0.1)
    clock.now += 0.2
    assert board.get("touched.head", 0) == 0
    assert board.keys() == ["name"]
    board.deliver()
    assert seen == [
        ("touched.head", "new", 1, 1),
        ("name", "new", "Pepper", "Pepper"),
        ("touched.head", "expired", None, 1),
    ]


def test_lifetime_can_be_shortened_extended_and_removed(board: nep.Blackboard, clock: Clock) -> None:
    board.put("x", 1, lives_s=100)
    board.put("x", 2, lives_s=1)
    clock.now += 1
    assert "x" not in board
    board.put("x", 3, lives_s=1)
    board.put("x", 4)
    clock.now += 1e9
    assert board["x"] == 4
    for life in (0, -1, math.nan, "3", True):
        with pytest.raises(ValueError, match="lives_s"):
            board.put("x", 5, lives_s=life)  # type: ignore[arg-type]
    board.put("x", 6, lives_s=math.inf)
    assert board["x"] == 6


def test_expiry_entries_of_evicted_keys_are_removed(clock: Clock) -> None:
    board = nep.Blackboard(clock=clock, max_keys=10)
    for number in range(5_000):
        board.put(f"x.{number}", 1, lives_s=1e6)
    assert len(board) == 10
    assert board.dropped == 4_990
    assert len(board._entries._expiry_heap) < 1_100
    assert len(board._entries._expiry_of) < 1_100
    clock.now += 1e6
    assert len(board) == 0


def test_keys_and_bytes_are_bounded(clock: Clock) -> None:
    seen: list[str] = []
    board = nep.Blackboard(clock=clock, max_keys=2)
    board.on_change("**", lambda change: seen.append(f"{change.cause} {change.key}"))
    for key in ("a", "b", "a", "c"):
        board.put(key, key)
    board.deliver()
    assert board.keys() == ["a", "c"], "what was told longest ago goes"
    assert board.dropped == 1
    assert seen == ["new a", "new b", "new c", "dropped b"]
    small = nep.Blackboard(max_bytes=10_000)
    for number in range(100):
        small.put(str(number), "x" * 1_000)
    assert 0 < len(small) < 10
    assert small.bytes <= 10_000
    before = small.keys()
    with pytest.raises(nep.BadValueError, match=r"'large' .*10000 "):
        small.put("large", "x" * 8_000_000)
    assert small.keys() == before
    small.put("99", "")
    for key in before:
        small.remove(key)
    assert (len(small), small.bytes) == (0, 0)
    for wrong in (0, -1, 1.5, True, None):
        with pytest.raises(ValueError, match="max_keys"):
            nep.Blackboard(max_keys=wrong)  # type: ignore[arg-type]


def test_hundred_thousand_keys_are_supported(clock: Clock) -> None:
    board = nep.Blackboard(clock=clock)
    board.put("all", {str(number): {"x": number} for number in range(100_000)})
    assert len(board) == 100_000
    assert board["all.99999.x"] == 99_999
    assert board.keys("all.5.*") == ["all.5.x"]
    board.put("more", 1)
    assert (len(board), board.dropped, "all.0.x" in board) == (100_000, 1, False)
    assert board.remove("all") == 99_999
    assert board.keys() == ["more"]
    assert board.bytes < 2_000


def test_too_deep_or_recursive_values_are_rejected(board: nep.Blackboard) -> None:
    loop: list[object] = []
    loop.append(loop)
    round_: dict[str, object] = {}
    round_["a"] = round_
    deep: object = 1
    for _number in range(10_000):
        deep = [deep]
    for value in (loop, round_, deep):
        with pytest.raises(nep.BadValueError, match=r"'x' .*contains itself, .*levels"):
            board.put("x", value)
    assert len(board) == 0
    level: object = 1
    for _number in range(50):
        level = {"a": level}
    board.put("x", level)
    assert board["x"] == level, "what goes down further than keys is a value"
    assert len(board) == 1


def test_maps_with_non_string_keys_are_stored(board: nep.Blackboard) -> None:
    board.put("x", {1: "one", "two": 2})
    assert board["x.1"] == "one"
    board.put("y", {None: 1, (1, 2): 3})
    assert board["y"] == {None: 1, (1, 2): 3}
    with pytest.raises(nep.BadKeyError):
        board.put("z", {"ok": 1, "x" * 2_000: 1})
    assert "z" not in board


def test_change_is_reported_for_another_value_or_type(board: nep.Blackboard) -> None:
    seen: list[object] = []
    end = board.on_change("x", lambda change: seen.append(change.value))
    for value in (1, 1, True, 1.0, "1", "1", [1], [1], None, None):
        board.put("x", value)
    assert board.deliver() == 6
    assert [repr(each) for each in seen] == ["1", "True", "1.0", "'1'", "[1]", "None"]
    board.put("x", 5)
    end()
    end()
    board.deliver()
    assert len(seen) == 6


def test_callback_that_raises_does_not_lose_other_changes(board: nep.Blackboard) -> None:
    seen: list[object] = []

    def callback(change: nep.BlackboardChange) -> None:
        if change.value == 2:
            raise ZeroDivisionError("two")
        seen.append(change.value)

    board.on_change("x", callback)
    board.on_change("x", lambda change: seen.append(f"other {change.value}"))
    for value in (1, 2, 3):
        board.put("x", value)
    with pytest.raises(ZeroDivisionError):
        board.deliver()
    board.deliver()
    assert seen == [1, "other 1", "other 2", 3, "other 3"]


def test_callback_that_writes_its_own_key_does_not_loop_forever(board: nep.Blackboard) -> None:
    board.on_change("x", lambda change: board.put("x", change.value + 1))  # type: ignore[operator]
    board.put("x", 0)
    assert board.deliver() == 1
    assert board.deliver() == 1
    assert board["x"] == 2


def test_undelivered_changes_are_bounded() -> None:
    board = nep.Blackboard(max_bytes=100_000)
    board.on_change("x", lambda _change: None)
    for number in range(12_000):
        board.put("x", number)
    assert board.changes_dropped >= 2_000
    for number in range(100):
        board.put("x", str(number) * 10_000)
    assert board._pending_bytes <= 200_000
    waiting = len(board._pending)
    assert board.deliver() == waiting
    assert board._pending_bytes == 0


def test_wait_for_returns_on_a_matching_value_or_times_out(board: nep.Blackboard) -> None:
    assert_waits(board, lambda: board.wait_for("x.y", timeout_s=30.0), lambda: board.put("x", {"y": 1}), 1)
    assert_waits(board, lambda: board.wait_for("n", lambda n: n > 2, 30.0), lambda: board.put("n", 3), 3)  # type: ignore[operator]
    board.put("n", 1)
    with pytest.raises(nep.WaitTimeoutError, match="timed out after 0 s while waiting for n"):
        board.wait_for("n", lambda n: n == 3, 0)
    with pytest.raises(ZeroDivisionError):
        board.wait_for("n", lambda n: 1 / 0)
    for wrong in (-1, math.nan, "1"):
        with pytest.raises(ValueError, match="timeout_s"):
            board.wait_for("n", timeout_s=wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="condition"):
        board.wait_for("n", 5)  # type: ignore[arg-type]


def assert_waits(
    board: nep.Blackboard, wait: Callable[[], object], act: Callable[[], object], value: object
) -> None:
    found: list[object] = []
    thread = threading.Thread(target=lambda: found.append(wait()))
    thread.start()
    act()
    thread.join(60.0)
    assert found == [value]


def test_close_wakes_a_waiting_thread(board: nep.Blackboard) -> None:
    raised = threading.Event()
    waits = threading.Event()

    def wait() -> None:
        board.put("x", 1)
        try:
            board.wait_for("x", lambda _value: waits.set())
        except nep.ClosedError:
            raised.set()

    thread = threading.Thread(target=wait)
    thread.start()
    assert waits.wait(60.0)
    board.close()
    thread.join(60.0)
    assert raised.is_set()
    board.close()
    board.put("x", 2)
    assert board.wait_for("x") == 2, "what is there is still read"
    with pytest.raises(nep.ClosedError, match="the blackboard is closed"):
        board.wait_for("y")


def test_concurrent_reads_and_writes_are_consistent(board: nep.Blackboard) -> None:
    wrong: list[object] = []
    done = threading.Event()

    def write(name: str) -> None:
        for number in range(300):
            board.put("pair", {"a": number, "b": number})
            board.put(f"own.{name}", number)
            if number % 50 == 0:
                board.put("pair", 0)

    def read() -> None:
        while not done.is_set():
            pair = board.get("pair", 0)
            if pair != 0 and pair["a"] != pair["b"]:  # type: ignore[index]
                wrong.append(pair)
            board.keys("**")
            board.snapshot()
            board.deliver()

    board.on_change("pair.**", lambda _change: None)
    writers = [threading.Thread(target=write, args=(name,)) for name in "abc"]
    reader = threading.Thread(target=read)
    for thread in (reader, *writers):
        thread.start()
    for thread in writers:
        thread.join(120.0)
    done.set()
    reader.join(60.0)
    assert wrong == []
    assert board["own"] == {"a": 299, "b": 299, "c": 299}


def test_watch_without_a_node_is_rejected(board: nep.Blackboard) -> None:
    with pytest.raises(nep.NepError, match="has no node"):
        board.watch("/x")


def test_unreferenced_board_is_freed(clock: Clock) -> None:
    import weakref

    board = nep.Blackboard(clock=clock)
    board.put("x", 1)
    seen = weakref.ref(board)
    del board
    gc.collect()
    assert seen() is None


def test_coroutine_callback_without_event_loop_is_rejected() -> None:
    async def changed(_change: object) -> None: ...

    with pytest.raises(ValueError, match="callback is a coroutine function"):
        nep.Blackboard().on_change("*", changed)
