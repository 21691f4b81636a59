"""Reading and writing: Jacobians, tables, provenance."""
