"""Programs built from nodes that also run as commands, such as bridges, blackboards and alarms."""
