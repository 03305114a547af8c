"""The blackboard: what is known of the world, key by key, and how old it is. `nep.Blackboard`."""
