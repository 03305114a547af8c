"""Blocks as data, and the compiler from a workspace to a Python program.

This package exports the compiler and the definitions for the editor; exported programs import
`app.blocks.commands`. ``editor/`` contains the editor's page in TypeScript.
"""

from __future__ import annotations

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.model.program import Problem, Program
from app.blocks.toolbox.definitions import editor_definitions

__all__ = ["Problem", "Program", "compile_behaviour", "editor_definitions"]
