"""Base classes and parts that several back ends share. Contracts are in `nep.backends.base`."""
