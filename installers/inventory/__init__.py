"""What is inside a package, and under which licences: a bill of materials, licence texts, a notice."""
