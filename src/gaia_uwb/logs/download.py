"""Fetch a data set file by file, each checked against its SHA-256; find the folder it lies in.

The package carries a manifest per data set (``outdoor-uwb.json``): where the files are, by commit,
with size and SHA-256. Nobody at the other end can take more memory, disk or time than these allow.
A file has its final name only once it is complete and right, so that an
interrupted download resumes where it stopped, and a folder never holds half a file; what a killed
download left under temporary names is removed by the next one.
"""

from __future__ import annotations

import hashlib
import json
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from importlib import resources
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple
from urllib.parse import quote, urlsplit
from urllib.request import url2pathname

from gaia_uwb._shared import (
    DownloadError,
    SourceError,
    open_regular,
    remove_abandoned,
    temporary_path,
)
from gaia_uwb.logs.registry import REGISTRY

DATA_DIR_VARIABLE = "GAIA_DATA_DIR"
"""Environment variable that names the data folder."""

_N_CONNECTIONS = 8
_TIMEOUT_S = 30.0  # without a byte
_PATIENCE_S, _SLOWEST_BYTES_PER_S = 60.0, 20_000.0  # for all files together
_GRACE_S = 2.0
_CHUNK_BYTES = 2**16


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
    files = {path: Promised(*promised) for path, promised in manifest["files"].items()}
    folder = data_folder(data_dir) / name
    base = str(manifest["base_url"] if base_url is None else base_url)
    for place in {(folder / path).parent for path in files}:
        remove_abandoned(place)
    missing = [path for path, promised in files.items() if not _is_there(folder / path, promised)]
    n_there = len(files) - len(missing)
    report = progress or (lambda done, total: None)
    report(n_there, len(files))
    n_bytes = sum(files[path].n_bytes for path in missing)
    limit = _Limit(_PATIENCE_S + n_bytes / _SLOWEST_BYTES_PER_S)
    jobs = [partial(_fetch_file, base, path, folder, files[path], limit) for path in missing]
    for n_arrived, _ in enumerate(_at_once(jobs, limit), start=1):
        report(n_there + n_arrived, len(files))
    return folder


class Promised(NamedTuple):
    """What a manifest says of a file."""

    n_bytes: int
    sha256: str


class _Limit:
    """How long all of a download may take; it is also over once somebody gives up."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._end = time.monotonic() + seconds
        self._given_up = threading.Event()

    def left_s(self) -> float:
        return max(0.0, self._end - time.monotonic())

    def give_up(self) -> None:
        self._given_up.set()

    def check(self) -> None:
        """Raise an error if it is over."""
        if self._given_up.is_set() or not self.left_s():
            raise self.error()

    def error(self) -> DownloadError:
        problem = f"not complete within {self.seconds:.0f} s; run it again to resume"
        return DownloadError(problem)


def _at_once(jobs: Sequence[Callable[[], None]], limit: _Limit) -> Iterator[None]:
    """Run jobs in some threads and yield as each is done; the first error ends all.

    The threads do not keep the program from ending: a server that sends a byte now and then, before
    any content, could hold them for ever.
    """
    waiting: SimpleQueue[Callable[[], None]] = SimpleQueue()
    done: SimpleQueue[BaseException | None] = SimpleQueue()
    for job in jobs:
        waiting.put(job)

    def work() -> None:
        with suppress(Empty):
            while True:
                job = waiting.get_nowait()
                try:
                    limit.check()
                    job()
                except BaseException as error:  # raised again where somebody waits
                    done.put(error)
                else:
                    done.put(None)

    threads = [threading.Thread(target=work, daemon=True) for _ in jobs[:_N_CONNECTIONS]]
    try:
        for thread in threads:
            thread.start()
        for _ in jobs:
            try:
                error = done.get(timeout=limit.left_s() + _GRACE_S)
            except Empty:
                raise limit.error() from None
            if error is not None:
                raise error
            yield
    finally:
        limit.give_up()
        for thread in threads:
            thread.join(_GRACE_S)  # so that what they write is removed


def read_manifest(name: str) -> dict[str, Any]:
    """Return a data set's manifest: where its files are, and the size and SHA-256 of each."""
    text = resources.files("gaia_uwb.logs").joinpath(f"{name}.json").read_text("utf-8")
    manifest: dict[str, Any] = json.loads(text)
    return manifest


def _is_there(path: Path, promised: Promised) -> bool:
    import pooch

    return path.is_file() and pooch.file_hash(path) == promised.sha256


def _fetch_file(base: str, path: str, folder: Path, promised: Promised, limit: _Limit) -> None:
    """Fetch one file under a temporary name, check it, and give it its name."""
    target = folder / path
    temporary = temporary_path(target.parent, target.name)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        digest = hashlib.sha256()
        left = promised.n_bytes
        with temporary.open("xb") as file:
            for chunk in _transfer(base, path):
                limit.check()
                left -= len(chunk)
                if left < 0:
                    problem = f"expected {promised.n_bytes:,} bytes, got more from {base}"
                    raise DownloadError(f"{path}: {problem}")
                digest.update(chunk)
                file.write(chunk)
        got = digest.hexdigest()
        if got != promised.sha256:
            raise DownloadError(
                f"{path}: expected SHA-256 {promised.sha256}, got {got} from {base}"
            )
        temporary.replace(target)
    except OSError as error:  # of reading, it is told where that happens
        reason = error.strerror or str(error)
        raise DownloadError(f"{target}: cannot be written: {reason}") from error
    finally:
        with suppress(OSError):  # renamed, or there is no such folder
            temporary.unlink()


def _transfer(base: str, path: str) -> Iterator[bytes]:
    """Yield a file's content, piece by piece, from a folder or a server.

    Raises
    ------
    DownloadError
        If that fails.
    """
    try:
        address = urlsplit(base)
        if address.scheme in {"http", "https"}:
            yield from _content_at(f"{base.rstrip('/')}/{quote(path)}")
        else:
            source = Path(url2pathname(address.path)) if address.scheme == "file" else Path(base)
            with open_regular(source / path) as file:
                while chunk := file.read(_CHUNK_BYTES):
                    yield chunk
    except Exception as error:  # requests, urllib3 and http.client have no common base but this
        reason = " ".join(str(error).split()) or type(error).__name__
        raise DownloadError(f"{path}: cannot be fetched from {base}: {reason}") from error


def _content_at(url: str) -> Iterator[bytes]:
    """Yield what a server sends, as it comes in and never unpacked: its size is promised."""
    import requests

    with requests.get(
        url,
        stream=True,
        timeout=_TIMEOUT_S,
        headers={"Accept-Encoding": "identity"},
        hooks={"response": _close_redirect},
    ) as response:
        response.raise_for_status()
        while chunk := response.raw.read1(_CHUNK_BYTES, decode_content=False):
            yield chunk


def _close_redirect(response: Any, **_: object) -> None:
    """Leave the content of an answer that only points elsewhere: requests would read it whole."""
    if response.is_redirect:
        response.close()
