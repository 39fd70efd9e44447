"""Finding a data set's file in a local folder, or fetching it with its checksum."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Final

from northdown.datasets.registry import DataSet
from northdown.errors import InputError, expected
from northdown.io.optional import import_optional
from northdown.io.source import quoted

ENVIRONMENT: Final = "NORTHDOWN_DATA"
_TIMEOUT: Final = 30.0


def folders(data: DataSet, root: str | os.PathLike[str] | None) -> list[Path]:
    """Folders in which a data set's files may be: a folder of its name under the root, or the root itself."""
    base = _root(root)
    return [base / data.name, base]


def local_files(data: DataSet, root: str | os.PathLike[str] | None, pattern: str) -> list[Path]:
    """Files whose names match a regular expression, in the first folder that has any, by name."""
    for folder in folders(data, root):
        if folder.is_dir():
            found = sorted(path for path in folder.iterdir() if re.fullmatch(pattern, path.name) and path.is_file())
            if found:
                return found
    return []


def locate(
    data: DataSet,
    pattern: str,
    what: str,
    root: str | os.PathLike[str] | None = None,
    *,
    download: bool = False,
    base_url: str | None = None,
) -> Path:
    """Find a file, in the folder or, if asked, on the network.

    Parameters
    ----------
    data : DataSet
        The data set.
    pattern : str
        Regular expression of the file's whole name; of several files the first is taken, ``.mat`` before others.
    what : str
        What it is, for messages.
    root, download, base_url
        As for `northdown.datasets.broad`.

    Raises
    ------
    InputError
        When it is not there and not to be, or cannot be, downloaded.
    """
    found = local_files(data, root, pattern)
    if found:
        return _preferred(found)
    known = sorted(Path(name) for name in data.sha256 if re.fullmatch(pattern, name))
    place = str(folders(data, root)[0])
    if not download:
        how = " or pass download=True" if known else ""
        do = f"put the file there, set root=… or {ENVIRONMENT} to the folder with {data.name}/{how and ','}{how}"
        raise InputError(expected(f"{what} in {quoted(place, 200)}", "no such file", do=do))
    if not known:
        do = f"get it from {data.base_url} and put it into {quoted(place, 200)}"
        raise InputError(expected(f"a file with a known checksum for {what}", "none", do=do))
    return _fetch(data, _preferred(known).name, Path(place), base_url or data.base_url)


def _preferred(paths: list[Path]) -> Path:
    return min(paths, key=lambda path: (path.suffix != ".mat", path.name))


def _root(root: str | os.PathLike[str] | None) -> Path:
    if root is not None:
        return Path(root)
    value = os.environ.get(ENVIRONMENT)
    if value:
        return Path(value)
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(cache) / "northdown"


def _fetch(data: DataSet, file: str, folder: Path, base_url: str) -> Path:
    """Download one file; it takes its place only when its checksum is right."""
    pooch = import_optional("pooch", "download")
    url = f"{base_url.rstrip('/')}/{data.path(file)}"
    try:
        path = pooch.retrieve(
            url,
            known_hash=f"sha256:{data.sha256[file]}",
            fname=file,
            path=folder,
            # not streamed: pooch leaves the connection of a refused stream open
            downloader=pooch.HTTPDownloader(timeout=_TIMEOUT, stream=False),
        )
    except ValueError as error:
        if "hash" not in str(error):
            raise InputError(expected(f"an address to download {file} from", quoted(url, 200))) from None
        do = "nothing was kept; try again, or get the file by hand"
        raise InputError(expected(f"{file} with its known SHA-256", f"other content from {url}", do=do)) from None
    except OSError as error:  # all that the network and the disk can refuse
        reason = type(error).__name__
        do = "check the network, or get the file by hand"
        raise InputError(expected(f"to download {url}", reason, do=do)) from None
    return Path(path)
