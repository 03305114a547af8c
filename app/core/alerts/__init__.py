"""Active problems and their next steps. Alarms that a person defines are in `app.core.parts.alarms`."""
