"""The virtual robot's room, body, camera and eyes: no messaging in here."""
