"""Tests of parameters: a node declares them; other nodes read and set them while it runs."""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Iterator, Mapping

import pytest

import nep
from nep.masters.master import Master
from nep.patterns.parameters.node_parameters import parameters_topic
from tests.nep.meeting import Make
from tests.nep.programs import eventually, running


@pytest.fixture
def pair(master: Master) -> Iterator[tuple[nep.Node, nep.Node]]:
    with nep.node("robot") as node, nep.node("tool") as other:
        yield node, other


def test_parameters_are_declared_read_and_set(make: Make) -> None:
    parameters = make("robot").parameters
    assert parameters.list() == ()
    assert parameters.declare("speed", 0.5, min=0, max=2, description="m/s") == 0.5
    assert parameters.declare("mode", "walk", choices=("walk", "run")) == "walk"
    assert parameters.declare("steps", 3) == 3
    parameters["speed"] = 1
    parameters.set("mode", "run")
    assert (parameters["speed"], type(parameters["speed"]), parameters.get("mode")) == (1.0, float, "run")
    assert [each.name for each in parameters.list()] == ["speed", "mode", "steps"]
    assert "speed" in parameters
    assert "other" not in parameters
    said = parameters.describe("speed")
    assert (said.default, said.minimum, said.maximum, said.description) == (0.5, 0, 2, "m/s")


def test_parameter_values_are_published_on_a_latched_topic(make: Make) -> None:
    """Other nodes can read them also over back ends without services."""
    node = make("robot")
    node.parameters.declare("speed", 0.5)
    node.parameters.declare("names", ["a"])
    node.parameters["speed"] = 0.75
    sub = make("tool").new_sub(parameters_topic(node.id), "nep/patterns/parameters")
    ok, state = sub.listen(timeout_s=30.0)
    assert ok
    assert state["node"] == "robot"  # type: ignore[index]
    assert {each["name"]: each["value"] for each in state["parameters"]} == {"speed": 0.75, "names": ["a"]}  # type: ignore[index]
    node.parameters["speed"] = 1.5
    ok, state = sub.listen(timeout_s=30.0)
    assert state["parameters"][0]["value"] == 1.5  # type: ignore[index]


def test_remote_node_sets_parameters_and_receives_rejection_reasons(make: Make) -> None:
    node, other = make("robot"), make("tool")
    node.parameters.declare("speed", 0.5, max=2)
    node.parameters.declare("serial", "X1", read_only=True)
    if not hasattr(node._transport, "create_server"):
        with pytest.raises(nep.NepError, match="declared no parameters"):
            other.parameters_of("robot")
        return
    with other.parameters_of("robot", timeout_s=30.0) as theirs:
        theirs.set("speed", 1.5)
        assert (theirs.get("speed"), node.parameters["speed"]) == (1.5, 1.5)
        refusals = {
            "the parameter 'speed' can't be 7: the maximum is 2": ("speed", 7),
            "the parameter 'speed' can't be 'fast': the value must be of type 'float'": ("speed", "fast"),
            "can't use the parameter 'spead': no such parameter; did you mean 'speed'?": ("spead", 1),
            "the parameter 'serial' can't be 'X2': only its node can change it": ("serial", "X2"),
        }
        for sentence, (name, value) in refusals.items():
            with pytest.raises(nep.RequestRefusedError) as raised:
                theirs.set(name, value)
            assert str(raised.value) == sentence
        with pytest.raises(nep.RequestRefusedError):
            theirs.set_all({"speed": 0.1, "serial": "X2"})
        theirs.set_all({"speed": 1, "serial": "X1"})
        assert node.parameters["speed"] == 1.0
        with pytest.raises(nep.NepError, match="unknown parameter 'spead'; did you mean 'speed'"):
            theirs.get("spead")
        assert [each["read_only"] for each in theirs.list()] == [False, True]
    node.parameters["serial"] = "X2"


def test_change_callback_can_reject_new_values(pair: tuple[nep.Node, nep.Node]) -> None:
    node, other = pair
    asked: list[tuple[dict[str, object], object, str]] = []

    def on_change(values: Mapping[str, object]) -> str | None:
        asked.append((dict(values), node.parameters["speed"], threading.current_thread().name))
        if values.get("speed") == 13:
            return "thirteen brings bad luck; use 12"
        if values.get("speed") == 0:
            raise ZeroDivisionError("nothing divides by it")
        return None

    node.parameters.declare("speed", 1)
    node.parameters.declare("other", 1)
    node.parameters.on_change(on_change)
    node.parameters.set_all({"speed": 2, "other": 1})
    assert asked[-1][:2] == ({"speed": 2}, 1), "only with what changes, and before it does"
    count_ = len(asked)
    node.parameters["speed"] = 2
    assert len(asked) == count_
    with pytest.raises(
        nep.ParameterError, match="can't use the parameter 'speed': thirteen brings bad luck; use 12"
    ):
        node.parameters["speed"] = 13
    with pytest.raises(ZeroDivisionError):
        node.parameters["speed"] = 0
    with other.parameters_of("robot", timeout_s=30.0) as theirs:
        with pytest.raises(nep.RequestRefusedError, match="thirteen brings bad luck; use 12"):
            theirs.set("speed", 13)
        with pytest.raises(nep.RequestRefusedError, match="nothing divides by it"):
            theirs.set_all({"other": 5, "speed": 0})
        assert (node.parameters["speed"], node.parameters["other"]) == (2, 1)
        theirs.set("speed", 3)
        assert asked[-1][2].startswith("nep-")
    assert node.parameters["speed"] == 3


def test_malformed_parameter_calls_are_rejected(pair: tuple[nep.Node, nep.Node]) -> None:
    node, other = pair
    node.parameters.declare("speed", 1)
    client = other.new_client(parameters_topic(node.id), timeout_s=30.0)
    for wrong in (None, 5, [], {"set": 5}, {"set": [1]}, "list"):
        answer = client.call(wrong)
        assert re.search(r"\bmap\b.*'set'", answer["refused"])  # type: ignore[index]
    assert client.call({})["parameters"][0]["value"] == 1  # type: ignore[index]
    assert client.call({"set": {"speed": [[]] * 10}})["refused"].startswith(
        "the parameter 'speed' can't be [[]"
    )  # type: ignore[index]
    assert len(client.call({"set": {"speed": "x" * 8_000_000}})["refused"]) < 500  # type: ignore[index]


@pytest.mark.parametrize(
    ("default", "limits", "wrong", "sentence"),
    [
        (1, {"min": 0}, -1, "the minimum is 0"),
        (1, {}, 1.5, "the value must be a whole number"),
        (1, {}, 2**63, "the value must be a finite number"),
        (1, {}, True, "the value must be of type 'int'"),
        (1.0, {}, float("nan"), "the value must be a finite number"),
        (1.0, {}, float("inf"), "the value must be a finite number"),
        (1.0, {}, 10**400, "the value must be a finite number"),
        pytest.param(
            1, {}, -(10**5000), "can't be a 'int': the value must be a finite number", id="5000 digits"
        ),
        (True, {}, 1, "the value must be of type 'bool'"),
        ("a", {"choices": ("a", "b")}, "c", "use 'a' or 'b'"),
        ("a", {}, None, "the value must be of type 'str'"),
        ("a", {}, b"a", "the value must be of type 'str'"),
        ([1], {}, (1,), "the value must be of type 'list'"),
        ([1], {}, [object()], "not JSON serializable"),
        ([1], {}, ["x" * 2_000_000], "1048576 are allowed"),
        ({}, {}, [], "the value must be of type 'dict'"),
        ({}, {}, {1: 2}, "Dict key must be str"),
    ],
)
def test_invalid_parameter_value_is_rejected(
    make: Make, default: object, limits: dict[str, object], wrong: object, sentence: str
) -> None:
    parameters = make("robot").parameters
    parameters.declare("x", default, **limits)  # type: ignore[arg-type]
    with pytest.raises(nep.ParameterError, match=sentence):
        parameters["x"] = wrong
    assert parameters["x"] == default


def test_whole_float_converts_to_int_and_int_to_float(make: Make) -> None:
    parameters = make("robot").parameters
    parameters.declare("i", 1)
    parameters.declare("f", 1, type=float)
    parameters.set_all({"i": 2.0, "f": 3})
    assert [(each.value, type(each.value)) for each in parameters.list()] == [(2, int), (3.0, float)]


def test_default_of_a_parameter_is_copied(make: Make) -> None:
    parameters = make("robot").parameters
    given = [1, {"a": [2]}]
    parameters.declare("x", given)
    given[1]["a"] = 5  # type: ignore[index]
    assert parameters["x"] == [1, {"a": [2]}]


@pytest.mark.parametrize(
    ("name", "default", "more", "sentence"),
    [
        ("x", 1, {}, "'x' can't be 1: .*'set'"),
        ("y", 5, {"max": 2}, "the maximum is 2"),
        ("y", 5, {"choices": (1, 2)}, "use 1 or 2"),
        ("y", 5, {"choices": (1, "a")}, "the value must be of type 'int'"),
        ("y", "a", {"max": 2}, "'y' can't be 'a': .*limits"),
        ("y", 1, {"max": float("nan")}, "'y' can't be 1: .*limits .*finite"),
        ("y", 1, {"type": bytes}, "the type must be 'bool', 'int'"),
        ("y", None, {}, "the type must be 'bool', 'int'"),
        ("a b", 1, {}, "'a b' .*the character ' '"),
        ("", 1, {}, "'' .*1 to 200"),
    ],
)
def test_invalid_parameter_declaration_is_rejected(
    make: Make, name: str, default: object, more: dict[str, object], sentence: str
) -> None:
    parameters = make("robot").parameters
    parameters.declare("x", 1)
    with pytest.raises(ValueError, match=sentence):
        parameters.declare(name, default, **more)  # type: ignore[arg-type]
    assert [each.name for each in parameters.list()] == ["x"]


def test_number_of_parameters_is_limited(make: Make) -> None:
    parameters = make("robot").parameters
    parameters._parameters = {str(n): None for n in range(1000)}  # type: ignore[misc]
    with pytest.raises(nep.ParameterError, match="a node can have at most 1000 parameters"):
        parameters.declare("x", 1)


def test_parameters_are_found_by_node_id_and_ambiguous_or_unknown_names_are_rejected(master: Master) -> None:
    with nep.node("a") as one, nep.node("a") as two, nep.node("b"), nep.node("tool") as tool:
        with pytest.raises(nep.NepError, match="no node is named 'a'; no node has parameters"):
            tool.parameters_of("a")
        tool.new_pub("x")
        with pytest.raises(nep.NepError, match="the node 'tool' has declared no parameters"):
            tool.parameters_of("tool")
        for node in (one, two):
            node.parameters.declare("who", node.id)
        with pytest.raises(nep.NepError, match=f"2 nodes .*'a'; .*{one.id}"):
            tool.parameters_of("a")
        with tool.parameters_of(two.id, timeout_s=30.0) as theirs:
            assert theirs.get("who") == two.id
        with pytest.raises(nep.NepError, match="no node is named 'aa'; did you mean 'a'"):
            tool.parameters_of("aa")


def test_declare_without_a_master_raises_and_declares_no_parameter() -> None:
    with nep.node("a", master="127.0.0.1:1", wait_s=0.1) as node:
        with pytest.raises(nep.MasterUnreachable):
            node.parameters.declare("x", 1)
        assert node.parameters.list() == ()


def test_parameters_of_a_closed_node_can_be_set_but_not_declared(master: Master) -> None:
    node = nep.node("a")
    node.parameters.declare("x", 1)
    node.close()
    node.parameters["x"] = 2
    assert node.parameters["x"] == 2
    with pytest.raises(nep.ClosedError):
        node.parameters_of("b")
    with nep.node("never") as closed:
        pass
    with pytest.raises(nep.ClosedError):
        closed.parameters.declare("x", 1)


def test_concurrent_changes_of_several_parameters_are_atomic(pair: tuple[nep.Node, nep.Node]) -> None:
    node, other = pair
    node.parameters.declare("a", 0)
    node.parameters.declare("b", 0)
    seen: list[bool] = []
    node.parameters.on_change(lambda _values: seen.append(node.parameters["a"] == node.parameters["b"]))  # type: ignore[func-returns-value]

    def work(start: int) -> None:
        for n in range(start, start + 50):
            node.parameters.set_all({"a": n, "b": n})

    def work_outside() -> None:
        with other.parameters_of("robot", timeout_s=30.0) as theirs:
            for n in range(50):
                theirs.set_all({"a": n, "b": n})

    threads = [threading.Thread(target=work, args=(1000 * n,)) for n in range(1, 3)]
    threads.append(threading.Thread(target=work_outside))
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert all(seen)
    assert len(seen) >= 100
    assert node.parameters["a"] == node.parameters["b"]


def test_reading_parameters_of_a_killed_node_raises(master: Master) -> None:
    code = """
    import nep
    node = nep.node("robot")
    node.parameters.declare("speed", 1)
    print("there")
    input()
    """
    with running(code) as program, nep.node("tool") as tool:
        assert program.line() == "there"
        with tool.parameters_of("robot", timeout_s=30.0) as theirs:
            assert theirs.get("speed") == 1
            program.process.kill()
            program.process.wait()
            with pytest.raises(nep.NepError):
                theirs.get("speed")
        eventually(lambda: "robot" not in {each.name for each in tool.graph().nodes.values()})


@pytest.mark.skipif(not hasattr(os, "fork"), reason="Windows does not fork")
def test_parameter_change_in_a_forked_child_stays_local(master: Master) -> None:
    code = """
    import os, nep
    node = nep.node("robot")
    node.parameters.declare("speed", 1)
    pid = os.fork()
    if not pid:
        node.parameters["speed"] = 2
        os._exit(3 if node.parameters["speed"] == 2 else 4)
    print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), node.parameters["speed"])
    """
    with running(code) as program:
        assert program.line() == "3 1"
        assert program.end()[1] == ""
