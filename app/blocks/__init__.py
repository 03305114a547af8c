"""Blocks as data, and the compiler that turns a workspace into a Python program."""

from __future__ import annotations

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.model.program import Problem, Program
from app.blocks.toolbox.definitions import editor_definitions

__all__ = ["Problem", "Program", "compile_behaviour", "editor_definitions"]
