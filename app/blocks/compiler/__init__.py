"""From a workspace to a program: templates filled with syntax trees, rendered for people and to run.

`compiler.compile_behaviour` is the way in; `problems` has the sentences that people see before Run.
"""
