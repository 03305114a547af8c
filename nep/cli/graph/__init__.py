"""Commands for nodes, services, parameters and logs. Not for topics (`nep.cli.topics.topics`)."""
