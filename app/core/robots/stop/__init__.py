"""Stop: recipients, required confirmations, proof, and robots that may still move.

Asking the user before a robot moves is the task of `app.core.robots.motion`.
"""
