"""Reading and writing: files, tables, provenance, studies and their pages."""
