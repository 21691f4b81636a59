"""Reading and writing: files, tables, rounded numbers, where a result comes from."""
