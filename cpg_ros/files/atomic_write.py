"""Files are written whole or not at all: beside, then renamed."""

import os
from pathlib import Path


def write_atomically(path: str | Path, content: str | bytes) -> None:
    """Write a file, which until then stays what it was.

    Raises:
        OSError: it cannot be written; the error has the file's name, also where a disk is full.

    """
    path = Path(path)
    beside = path.with_name(f'.{path.name}.{os.getpid()}.part')
    try:
        beside.write_bytes(content.encode() if isinstance(content, str) else content)
        beside.replace(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        beside.unlink(missing_ok=True)
