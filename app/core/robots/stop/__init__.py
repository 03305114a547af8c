"""Stop: recipients, required confirmations, proof, and the robots that may still move.

The question before a robot moves is in `app.core.robots.motion`.
"""
