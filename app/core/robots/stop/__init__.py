"""Stop: robots to stop, required confirmations, proof, and robots that may still move.

`app.core.robots.motion` asks the user before a robot moves.
"""
