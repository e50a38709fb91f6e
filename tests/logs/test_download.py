from __future__ import annotations

import errno
import gzip
import hashlib
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pooch
import pytest

from gaia_uwb._shared.errors import DownloadError, SourceError
from gaia_uwb.logs import download as module
from gaia_uwb.logs.download import data_folder, dataset_folder, fetch, read_manifest

FILES = {f"Case_{k}/A {k}.csv": f"t,range\n{k},5\n".encode() for k in range(20)}


class QuietHandler(SimpleHTTPRequestHandler):
    def log_message(self, *args: object) -> None:
        """Say nothing."""


@pytest.fixture
def mirror(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small data set in a folder, and a manifest that promises it."""
    folder = tmp_path / "mirror"
    for name, content in FILES.items():
        (folder / name).parent.mkdir(parents=True)
        (folder / name).write_bytes(content)
    files = {
        name: [len(content), hashlib.sha256(content).hexdigest()] for name, content in FILES.items()
    }
    manifest = {"base_url": "http://127.0.0.1:9/nobody-listens", "files": files}
    monkeypatch.setattr(module, "read_manifest", lambda name: manifest)
    return folder


@pytest.fixture
def server(mirror: Path) -> Iterator[str]:
    """The address of a web server that serves the mirror."""
    handler = partial(QuietHandler, directory=str(mirror))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as httpd:
        thread = threading.Thread(target=httpd.serve_forever, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{httpd.server_port}"
        httpd.shutdown()
        thread.join()


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_fetches_from_a_server(server: str, tmp_path: Path) -> None:
    steps: list[tuple[int, int]] = []
    folder = fetch(
        "outdoor-uwb",
        tmp_path / "data",
        base_url=server + "/",
        progress=lambda done, total: steps.append((done, total)),
    )
    assert folder == tmp_path / "data" / "outdoor-uwb"
    assert contents(folder) == FILES
    assert steps == [(k, 20) for k in range(21)]


@pytest.mark.parametrize("as_url", [True, False])
def test_fetches_from_a_folder(mirror: Path, tmp_path: Path, as_url: bool) -> None:
    base_url = mirror.as_uri() if as_url else str(mirror)
    assert contents(fetch("outdoor-uwb", tmp_path / "data", base_url=base_url)) == FILES


def test_goes_on_where_it_was_interrupted(
    mirror: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    transfer = module._transfer

    def count(base: str, path: str) -> Iterator[bytes]:
        asked.append(path)
        if len(asked) == 8:
            yield b"half"
            raise KeyboardInterrupt
        yield from transfer(base, path)

    monkeypatch.setattr(module, "_transfer", count)
    folder = tmp_path / "data" / "outdoor-uwb"
    with pytest.raises(KeyboardInterrupt):
        fetch("outdoor-uwb", tmp_path / "data", base_url=str(mirror))
    arrived = contents(folder)
    assert 0 < len(arrived) < 20
    assert all(FILES[name] == content for name, content in arrived.items())
    # One that was damaged meanwhile is fetched again; the others that are there are not.
    damaged = next(iter(arrived))
    (folder / damaged).write_bytes(b"damaged")
    asked[:] = [""] * 100
    fetch("outdoor-uwb", tmp_path / "data", base_url=str(mirror))
    assert sorted(asked[100:]) == sorted([*(FILES.keys() - arrived.keys()), damaged])
    assert contents(folder) == FILES


FETCH = """
import sys, time
from pathlib import Path
from gaia_uwb.logs import download as module

def wait(base, path):
    yield b"half a fi"
    print("half", flush=True)
    time.sleep(60)

module.read_manifest = lambda name: {"base_url": "", "files": {"Case_3/A 3.csv": [20, "0" * 64]}}
module._transfer = wait
module.fetch("outdoor-uwb", Path(sys.argv[1]))
"""


def test_the_next_fetch_removes_what_a_killed_one_left(mirror: Path, tmp_path: Path) -> None:
    data = tmp_path / "data"
    case = data / "outdoor-uwb" / "Case_3"
    case.mkdir(parents=True)
    mine = {case / name for name in (".A 3.csv", ".A 3.csv.swp", "notes.txt")}
    for path in mine:
        path.touch()
    runs = [
        subprocess.Popen([sys.executable, "-c", FETCH, str(data)], stdout=subprocess.PIPE)
        for _ in range(2)
    ]
    for run in runs:
        assert run.stdout is not None
        assert run.stdout.readline() == b"half\n"
    killed, alive = runs
    killed.kill()
    killed.wait()
    assert len(set(case.iterdir()) - mine) == 2
    fetch("outdoor-uwb", data, base_url=str(mirror))
    (other,) = set(case.iterdir()) - mine - {case / "A 3.csv"}
    assert f"-{alive.pid}-" in other.name
    alive.kill()
    alive.wait()
    fetch("outdoor-uwb", data)  # also where nothing is missing
    assert set(case.iterdir()) == {*mine, case / "A 3.csv"}
    for run in runs:
        assert run.stdout is not None
        run.stdout.close()


def test_needs_no_mirror_when_all_is_there(mirror: Path, tmp_path: Path) -> None:
    fetch("outdoor-uwb", tmp_path, base_url=str(mirror))
    assert fetch("outdoor-uwb", tmp_path) == tmp_path / "outdoor-uwb"


def test_refuses_a_file_that_is_not_the_promised_one(
    server: str, mirror: Path, tmp_path: Path
) -> None:
    (mirror / "Case_3/A 3.csv").write_bytes(b"<p>moved")
    got = hashlib.sha256(b"<p>moved").hexdigest()
    wanted = hashlib.sha256(FILES["Case_3/A 3.csv"]).hexdigest()
    with pytest.raises(DownloadError, match=f"A 3.csv: expected SHA-256 {wanted}, got {got}"):
        fetch("outdoor-uwb", tmp_path / "data", base_url=server)
    arrived = contents(tmp_path / "data" / "outdoor-uwb")
    assert all(FILES[name] == content for name, content in arrived.items())
    assert "Case_3/A 3.csv" not in arrived


def test_a_file_that_is_not_there(server: str, mirror: Path, tmp_path: Path) -> None:
    (mirror / "Case_3/A 3.csv").unlink()
    for base_url in (server, str(mirror)):
        with pytest.raises(DownloadError, match=r"A 3\.csv: cannot be fetched from .*"):
            fetch("outdoor-uwb", tmp_path / "data", base_url=base_url)


class HostileHandler(QuietHandler):
    """Sends what never ends: content, packed content, drops of it, of headers, or of a redirect."""

    way: str

    def do_GET(self) -> None:
        with suppress(OSError):  # whoever listened has gone
            if self.way == "headers":
                self.wfile.write(b"HTTP/1.1 200 OK\r\nX-Slow: ")
                self._for_ever(b"x", 0.02)
            self.send_response(302 if self.way == "redirect" else 200)
            if self.way == "redirect":
                self.send_header("Location", "/elsewhere")
            if self.way == "packed":
                self.send_header("Content-Encoding", "gzip")
            self.end_headers()
            if self.way == "packed":
                self._for_ever(gzip.compress(bytes(2**20)), 0.0)
            self._for_ever(b"x" * (1 if self.way == "drops" else 2**16), 0.02)

    def _for_ever(self, content: bytes, pause_s: float) -> None:
        while not self.server.over.wait(pause_s):  # type: ignore[attr-defined]
            self.wfile.write(content)
            self.wfile.flush()


@pytest.mark.parametrize(
    ("way", "told"),
    [
        ("content", r"expected \d+ bytes, got more from"),
        ("packed", r"expected \d+ bytes, got more from"),
        ("drops", r"expected \d+ bytes, got more from"),
        ("redirect", "30 redirects"),
        ("headers", "not complete within 0 s; run it again to resume"),
    ],
)
def test_a_mirror_without_end_takes_neither_memory_nor_time(
    mirror: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str, told: str
) -> None:
    if way == "headers":
        for name in ("_PATIENCE_S", "_GRACE_S"):
            monkeypatch.setattr(module, name, 0.1)
    handler = type("Handler", (HostileHandler,), {"way": way})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as httpd:
        httpd.over = threading.Event()  # type: ignore[attr-defined]
        thread = threading.Thread(target=httpd.serve_forever, daemon=True)
        thread.start()
        try:
            with pytest.raises(DownloadError, match=told):
                fetch(
                    "outdoor-uwb",
                    tmp_path / "data",
                    base_url=f"http://127.0.0.1:{httpd.server_port}",
                )
        finally:
            httpd.over.set()  # type: ignore[attr-defined]
            httpd.shutdown()
            thread.join()
    if way != "headers":
        assert contents(tmp_path / "data") == {}


@pytest.mark.parametrize(
    "base_url", ["http://[::1", "http://", "http://host:port", "file://[", "http://\udcff/", "\0"]
)
def test_an_address_that_is_none(mirror: Path, tmp_path: Path, base_url: str) -> None:
    with pytest.raises(DownloadError, match="cannot be fetched from") as caught:
        fetch("outdoor-uwb", tmp_path / "data", base_url=base_url)
    assert "\n" not in str(caught.value)


def test_a_pipe_in_a_mirror_is_not_waited_for(mirror: Path, tmp_path: Path) -> None:
    (mirror / "Case_3/A 3.csv").unlink()
    os.mkfifo(mirror / "Case_3/A 3.csv")
    with pytest.raises(DownloadError, match=r"A 3\.csv: cannot be fetched .*not a regular file"):
        fetch("outdoor-uwb", tmp_path / "data", base_url=str(mirror))


def test_a_full_disk_is_told_of_the_file_that_is_written(
    mirror: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(base: str, path: str) -> Iterator[bytes]:
        yield b"t"
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))  # as if the file had been written

    monkeypatch.setattr(module, "_transfer", full)
    told = rf"{tmp_path}/data/outdoor-uwb/.*\.csv: cannot be written: No space left on device"
    with pytest.raises(DownloadError, match=told):
        fetch("outdoor-uwb", tmp_path / "data", base_url=str(mirror))


def test_nobody_listens(mirror: Path, tmp_path: Path) -> None:
    with pytest.raises(DownloadError, match="nobody-listens"):
        fetch("outdoor-uwb", tmp_path / "data")


def test_a_folder_that_cannot_be_made(mirror: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DownloadError, match="Not a directory"):
        fetch("outdoor-uwb", tmp_path / "file", base_url=str(mirror))


def test_unknown_data_set(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="unknown data set 'indoor'; available: outdoor-uwb"):
        fetch("indoor", tmp_path)


def test_data_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GAIA_DATA_DIR", str(tmp_path))
    assert data_folder(Path("named")) == Path("named")
    assert data_folder() == tmp_path
    monkeypatch.delenv("GAIA_DATA_DIR")
    assert data_folder() == Path(pooch.os_cache("gaia-uwb"))


def test_dataset_folder(tmp_path: Path) -> None:
    with pytest.raises(SourceError) as caught:
        dataset_folder("outdoor-uwb", tmp_path)
    assert f"outdoor-uwb is not in {tmp_path}; fetch it with 'gaia data fetch" in str(caught.value)
    (tmp_path / "outdoor-uwb").mkdir()
    assert dataset_folder("outdoor-uwb", tmp_path) == tmp_path / "outdoor-uwb"


def test_manifest_names_the_commit_and_all_runs() -> None:
    manifest = read_manifest("outdoor-uwb")
    assert manifest["base_url"].endswith(manifest["commit"])
    assert all(size > 0 and len(sha256) == 64 for size, sha256 in manifest["files"].values())
    assert sum(path.endswith("trajectory.csv") for path in manifest["files"]) == 8
    assert sum(path.startswith("Static") for path in manifest["files"]) == 767


@pytest.mark.real_data
def test_the_real_data_are_the_promised_ones(outdoor_dir: Path, tmp_path: Path) -> None:
    folder = fetch("outdoor-uwb", tmp_path, base_url=str(outdoor_dir / "outdoor-uwb"))
    assert len(contents(folder)) == len(read_manifest("outdoor-uwb")["files"])
