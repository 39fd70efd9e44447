"""Files appear whole or not at all: written beside the target under another name, then renamed."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from northdown.errors import InputError, expected


@contextmanager
def atomic_write(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a file for writing that takes the name `path` only when the block ends without an error.

    Parameters
    ----------
    path : str or os.PathLike
        Target. An existing file is replaced; through a symbolic link, the file it points to.

    Yields
    ------
    BinaryIO
        Open for reading and writing, at its start.

    Raises
    ------
    InputError
        When the folder does not exist, the target is a folder, or the system refuses to write.
    """
    try:
        target = Path(path).resolve()
        if target.is_dir():
            raise InputError(
                expected("the name of a file to write", f"the folder {str(path)!r}", do="add a file name")
            )
        if not target.parent.is_dir():
            raise InputError(expected("a folder that exists", f"{str(target.parent)!r}", do="make it first"))
        # created by open, not by tempfile, so that the user's umask sets its permissions
        draft = target.with_name(f".{target.name[:80]}.{secrets.token_hex(6)}.tmp")
        with open(draft, "x+b") as file:
            try:
                yield file
                file.flush()
                os.replace(draft, target)
            except BaseException:
                draft.unlink(missing_ok=True)
                raise
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise InputError(expected(f"to be able to write {str(path)!r}", reason.lower())) from None
    except ValueError as error:
        if isinstance(error, InputError) or "null" not in str(error):
            raise
        raise InputError(expected("the name of a file to write", f"{str(path)!r}")) from None
