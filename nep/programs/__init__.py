"""Programs made of nodes that also run as commands: bridges, blackboards, alarms; and what they share."""
