"""What a problem's button does to the blocks: pure functions from one workspace to the next.

The problems are found by `app.blocks.compiler` and listed, with their buttons, by
`app.core.documents.problems`.
"""
