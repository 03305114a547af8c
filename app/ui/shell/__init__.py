"""The window around the panels: bars, docks, dialogs, documents, commands, the start page."""
