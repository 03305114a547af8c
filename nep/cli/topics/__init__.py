"""Commands for topics: list, echo, publish and rates. Not for recorded topics, see `nep.cli.recordings`."""
