"""Fetch a data set file by file, each checked against its SHA-256; find the folder it lies in.

The package carries a manifest per data set (``outdoor-uwb.json``): where the files are, by commit,
and their SHA-256. A file has its final name only once it is complete and right, so that an
interrupted download resumes where it stopped, and a folder never holds half a file; what a killed
download left under temporary names is removed by the next one.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit
from urllib.request import url2pathname

from gaia_uwb._shared import DownloadError, SourceError, remove_abandoned, temporary_path
from gaia_uwb.logs.registry import REGISTRY

DATA_DIR_VARIABLE = "GAIA_DATA_DIR"
"""Environment variable that names the data folder."""

_N_CONNECTIONS = 8
_TIMEOUT_S = 30.0


def data_folder(data_dir: Path | None = None) -> Path:
    """Return the folder that holds one sub-folder per data set; it need not exist.

    Parameters
    ----------
    data_dir
        The folder, if the user named one; else the environment variable GAIA_DATA_DIR, else
        ``gaia-uwb`` in the user's cache.
    """
    if data_dir is not None:
        return data_dir
    if named := os.environ.get(DATA_DIR_VARIABLE):
        return Path(named)
    import pooch

    return Path(pooch.os_cache("gaia-uwb"))


def dataset_folder(name: str, data_dir: Path | None = None) -> Path:
    """Return the folder of a data set that has been fetched.

    Raises
    ------
    SourceError
        If it is not there; the message says how to get it and where it was looked for.
    """
    folder = data_folder(data_dir) / name
    if not folder.is_dir():
        raise SourceError(
            f"{name} is not in {folder.parent}; fetch it with 'gaia data fetch {name}', or name "
            f"the folder that holds it with --data-dir or {DATA_DIR_VARIABLE}"
        )
    return folder


def fetch(
    name: str,
    data_dir: Path | None = None,
    *,
    base_url: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Fetch a data set, or what is missing of it.

    Parameters
    ----------
    name
        Name in the registry.
    data_dir
        Data folder, see :func:`data_folder`.
    base_url
        Where to fetch from instead: an http or file address, or a folder, with the same files.
    progress
        Called with the number of files that are there and of all files, as they arrive.

    Returns
    -------
    Path
        The data set's folder.

    Raises
    ------
    SourceError
        If there is no such data set.
    DownloadError
        If a file cannot be fetched or written, or is not the one that the manifest promises.
    """
    if name not in REGISTRY:
        raise SourceError(f"unknown data set {name!r}; available: {', '.join(REGISTRY)}")
    manifest = read_manifest(name)
    files: dict[str, str] = manifest["files"]
    folder = data_folder(data_dir) / name
    base = str(manifest["base_url"] if base_url is None else base_url)
    for place in {(folder / path).parent for path in files}:
        remove_abandoned(place)
    missing = [path for path, sha256 in files.items() if not _is_there(folder / path, sha256)]
    n_there = len(files) - len(missing)
    report = progress or (lambda done, total: None)
    report(n_there, len(files))
    with ThreadPoolExecutor(_N_CONNECTIONS) as pool:
        jobs = [pool.submit(_fetch_file, base, path, folder, files[path]) for path in missing]
        try:
            for n_arrived, job in enumerate(as_completed(jobs), start=1):
                job.result()
                report(n_there + n_arrived, len(files))
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
    return folder


def read_manifest(name: str) -> dict[str, Any]:
    """Return a data set's manifest: where its files are, and the SHA-256 of each."""
    text = resources.files("gaia_uwb.logs").joinpath(f"{name}.json").read_text("utf-8")
    manifest: dict[str, Any] = json.loads(text)
    return manifest


def _is_there(path: Path, sha256: str) -> bool:
    import pooch

    return path.is_file() and pooch.file_hash(path) == sha256


def _fetch_file(base: str, path: str, folder: Path, sha256: str) -> None:
    """Fetch one file under a temporary name, check it, and give it its name."""
    import pooch

    target = folder / path
    partial = temporary_path(target.parent, target.name)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _transfer(base, path, partial)
        got = pooch.file_hash(partial)
        if got != sha256:
            raise DownloadError(f"{path}: expected SHA-256 {sha256}, got {got} from {base}")
        partial.replace(target)
    except OSError as error:
        reason = " ".join(str(error).split())
        raise DownloadError(f"{path}: cannot be fetched from {base}: {reason}") from error
    finally:
        with suppress(OSError):  # renamed, or there is no such folder
            partial.unlink()


def _transfer(base: str, path: str, partial: Path) -> None:
    """Copy a file from a folder or a server.

    Raises
    ------
    OSError
        If that fails (the errors of ``requests`` are such too).
    """
    import pooch

    address = urlsplit(base)
    if address.scheme in {"http", "https"}:
        # Not streamed: the files are small, and a refused stream would leave its socket open.
        downloader = pooch.HTTPDownloader(timeout=_TIMEOUT_S, stream=False)
        downloader(f"{base.rstrip('/')}/{quote(path)}", str(partial), None)
    else:
        source = Path(url2pathname(address.path)) if address.scheme == "file" else Path(base)
        shutil.copyfile(source / path, partial)
