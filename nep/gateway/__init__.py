"""The gateway: programs of the original NEP, all three wire generations, joined to the native graph."""
