"""Fixes for problems, as pure functions from one workspace to the next.

`app.blocks.compiler` finds the problems; `app.core.projects.problems` lists them with their buttons.
"""
