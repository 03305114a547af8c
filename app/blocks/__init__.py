"""Blocks as data, and the compiler from pages of blocks to a Python program.

This package exports the compiler and the definitions for the editor; exported programs import
`app.blocks.commands`. ``editor/`` contains the editor's page in TypeScript.
"""

from __future__ import annotations

from app.blocks.compiler.compiler import ProjectCompiler, compile_behaviour
from app.blocks.model.program import Problem, Program
from app.blocks.toolbox.definitions import editor_definitions

__all__ = ["Problem", "Program", "ProjectCompiler", "compile_behaviour", "editor_definitions"]
