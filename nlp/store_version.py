"""The version of a store: tables of a new file, migration of an older one."""

from nlp.errors import FileError, StoreError
from nlp.store_file import StoreFile
from nlp.store_schema import Schema
from nlp.store_verification import Checksums


def prepare(file: StoreFile, schema: Schema, checksums: Checksums) -> bool:
    """Bring a file to the schema's version; nothing is changed before it is known to be ours.

    Parameters
    ----------
    file
        The store's. A new one gets the tables; an older one is migrated, or a temporary copy of
        it if it is only read.
    schema
        The columns.
    checksums
        Of the records.

    Returns
    -------
    bool
        Whether the records had checksums already.

    Raises
    ------
    FileError
        If it is no such store, or too old.
    StoreError
        If it is damaged, or newer.
    """
    had_checksums = True
    version, owner = (file.value(f"PRAGMA {n}") for n in ("user_version", "application_id"))
    if file.writable and file.value("SELECT count(*) FROM sqlite_master") == 0:
        with file.transaction():
            for statement in schema.creation():
                file.execute(statement)
    elif owner != schema.application:
        kind = StoreError if file.was_ours else FileError
        raise kind("store", str(file.path), "the file of a campaign")
    elif version != schema.version:
        had_checksums = _migrate(file, schema, checksums, version)
    if file.writable:
        file.survive_crashes()
    _check_tables(file, schema)
    file.check_pages()
    return had_checksums


def _migrate(file: StoreFile, schema: Schema, checksums: Checksums, version: int) -> bool:
    """Take a store from an older version to the schema's; return whether it had checksums."""
    known = schema.version
    steps = [schema.migrations.get(v) for v in range(version, known)]
    if version > known:
        allowed = f"version {known} or older; a newer lockedjoint made it"
        raise StoreError("version of the store", version, allowed)
    if None in steps:
        allowed = f"version {known}; this one is too old to be brought up to it"
        raise FileError("version of the store", version, allowed)
    file.check_pages()
    if not file.writable:
        file.continue_in_copy()
    with file.transaction():
        for statement in (statement for step in steps for statement in step or ()):
            file.execute(statement)
        columns = file.execute("PRAGMA main.table_info(record)").fetchall()
        had_checksums = "checksum" in (name for _, name, *_ in columns)
        if not had_checksums:
            _add_checksums(file, schema, checksums)
        file.execute(f"PRAGMA user_version = {known}")
    return had_checksums


def _add_checksums(file: StoreFile, schema: Schema, checksums: Checksums) -> None:
    """Add checksums to a store from before there were any."""
    file.execute("ALTER TABLE record ADD COLUMN checksum BLOB")
    names = list(schema.values)
    select = f"SELECT rowid, cell, environment, start, {', '.join(names)} FROM record"
    update = "UPDATE record SET checksum = ? WHERE rowid = ?"
    for number, cell, environment, start, *values in file.execute(select):
        checksum = checksums.of(cell, environment)
        if checksum is not None:
            file.execute(update, (checksum(start, names, values), number))


def _check_tables(file: StoreFile, schema: Schema) -> None:
    """Refuse a file with other tables or columns, and with triggers or views."""
    select = "SELECT name, type FROM main.sqlite_master WHERE name NOT LIKE 'sqlite_%'"
    found: dict[str, object] = dict(file.execute(select).fetchall())
    for table in found:
        columns = file.execute(
            "SELECT name, type FROM pragma_table_xinfo(?, 'main') WHERE NOT hidden", (table,)
        )
        if found[table] == "table":
            found[table] = dict(columns.fetchall())
    if found != schema.tables():
        raise StoreError("store", str(file.path), "one that is intact (other tables)")
