"""Test of the handlers that run after all nodes are closed, in a separate process."""

from __future__ import annotations

from tests.nep.programs import running


def test_after_nodes_handlers_run_once_after_all_nodes_are_closed() -> None:
    program = """
        import atexit, nep
        from nep.system.exits import call_after_nodes, cancel_after_nodes
        node = nep.node("n", "memory")
        def library_ends(): print("library ends, node closed:", node._is_closed)
        def forgotten(): print("forgotten")
        for each in (library_ends, forgotten):
            atexit.register(each)
            call_after_nodes(each)
        cancel_after_nodes(forgotten)
        print("program ends, node closed:", node._is_closed)
    """
    with running(program) as ended:
        assert ended.end() == ("program ends, node closed: False\nlibrary ends, node closed: True\n", "")
