"""Motion of real robots: the question to the user, the gate for messages, and commands of bridges.

Proving that robots have stopped is the task of `app.core.robots.stop`.
"""
