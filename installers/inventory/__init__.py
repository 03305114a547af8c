"""Content of a package with its licences: bill of materials, licence texts, notice."""
