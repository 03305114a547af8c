"""Syntax trees of the sources, shared by the tests of a module (fixture `syntax_trees`)."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

R = TypeVar("R")
N = TypeVar("N", bound=ast.AST)
_cached: list[Any] = []


def cached(function: Callable[..., R]) -> Callable[..., R]:
    """Cache the results of a function until `clear`."""
    _cached.append(cache(function))
    return cast("Callable[..., R]", _cached[-1])


def clear() -> None:
    """Drop all cached results; the trees of all sources take hundreds of megabytes."""
    for function in _cached:
        function.cache_clear()


@cached
def parse(path: Path) -> ast.Module:
    """Return the syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


@cached
def _nodes_by_type(tree: ast.AST) -> Mapping[type[ast.AST], Sequence[ast.AST]]:
    found: dict[type[ast.AST], list[ast.AST]] = {}
    for node in ast.walk(tree):
        found.setdefault(type(node), []).append(node)
    return found


def nodes(tree: ast.AST, *types: type[N]) -> Iterator[N]:
    """Yield the nodes of these types in a tree, which is traversed only once."""
    found = _nodes_by_type(tree)
    for each in types:
        yield from cast("Sequence[N]", found.get(each, ()))
