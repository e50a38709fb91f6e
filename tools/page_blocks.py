"""Run the code blocks of a Markdown page as a reader would, and keep the outputs shown true.

The blocks of a page run in order, in one folder of their own that is empty at the start:

- ``bash`` blocks by ``bash -e``, with ``gaia`` on the path;
- ``python`` blocks in one namespace, so that a block continues where the previous one ended;
- a block with a title (```` ```yaml title="feed.yaml" ````) becomes a file of that name.

HTML comments, which no reader sees, control the rest; each is on its own line before a block:

==============================  ============================================================
``<!-- run first: COMMAND -->``  also run this, to make what the reader already has, such as a log
``<!-- not run: REASON -->``     skip the next block, and say why
``<!-- exit 1 -->``              the next block ends with this exit code
``<!-- output -->``              the next block shows what the block before it printed
==============================  ============================================================

In a shown output ``...`` stands for anything. ``python tools/page_blocks.py --update docs/*.md``
runs the pages and rewrites outputs that changed (or are only ``...``); ``--list`` names the blocks
that do not run.

>>> page = '''```python
... print(6 * 7)
... ```
...
... <!-- output -->
... ```text
... 42
... ```
... '''
>>> [block.kind for block in parse(page)]
['run', 'output']
"""

from __future__ import annotations

import argparse
import contextlib
import doctest
import io
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

RUNNABLE = ("bash", "python")
TIMEOUT_S = 600  # machines of tests are busy

_FENCE = re.compile(r'^(?P<ticks>`{3,})(?P<language>[\w+-]*)(?P<options>(?: \w+="[^"]*")*) *$')
_TITLE = re.compile(r'\btitle="([^"]*)"')
_COMMENT = re.compile(r"^<!-- (?P<word>run first|not run|exit|output)(?::? (?P<rest>.*?))? -->$")


class PageError(Exception):
    """A page whose blocks cannot be understood, or one of them failed."""


@dataclass(frozen=True)
class Block:
    """One block of a page.

    Parameters
    ----------
    line
        Of its opening fence, counted from 1.
    kind
        What is done with it.
    language
        As its fence says.
    text
        What is between its fences.
    note
        Name of the file, reason not to run it, or nothing.
    exit_code
        What a run block must end with.
    """

    line: int
    kind: Literal["run", "file", "output", "left out", "shown"]
    language: str
    text: str
    note: str = ""
    exit_code: int = 0


def parse(page: str) -> list[Block]:
    """Return the blocks of a page, in order.

    Parameters
    ----------
    page
        Its Markdown.

    Raises
    ------
    PageError
        If a fence is not closed or indented, a comment has no block after it, or an output nothing
        before it.

    Examples
    --------
    >>> parse("<!-- run first: gaia simulate --out log -->")[0].text
    'gaia simulate --out log'
    """
    lines = page.splitlines()
    blocks: list[Block] = []
    said: dict[str, str] = {}
    at = 0
    while at < len(lines):
        line, start = lines[at], at + 1
        comment, fence = _COMMENT.match(line), _FENCE.match(line)
        at += 1
        if comment and comment["word"] == "run first":
            blocks.append(Block(start, "run", "bash", comment["rest"]))
        elif comment:
            said[comment["word"]] = comment["rest"] or ""
        elif fence:
            end = next((k for k in range(at, len(lines)) if lines[k] == fence["ticks"]), None)
            if end is None:
                raise PageError(f"line {start}: this fence is not closed")
            blocks.append(_block(start, fence, "\n".join(lines[at:end]), said))
            said, at = {}, end + 1
        elif line.lstrip().startswith("```"):
            raise PageError(f"line {start}: expected a fence at the margin, got {line!r}")
        elif said and line.strip():
            raise PageError(f"line {start}: expected a block after a comment, got {line!r}")
    runs = [block.kind in ("run", "left out") for block in blocks]
    for k, block in enumerate(blocks):
        if block.kind == "output" and not any(runs[:k]):
            raise PageError(f"line {block.line}: an output block without a block before it")
    return blocks


def _block(line: int, fence: re.Match[str], text: str, said: Mapping[str, str]) -> Block:
    language, title = fence["language"], _TITLE.search(fence["options"])
    if "not run" in said:
        return Block(line, "left out", language, text, note=said["not run"])
    if "output" in said:
        return Block(line, "output", language, text)
    if title:
        return Block(line, "file", language, text, note=title[1])
    if language in RUNNABLE:
        return Block(line, "run", language, text, exit_code=int(said.get("exit", 0)))
    return Block(line, "shown", language, text)


@dataclass
class Runner:
    """Runs the blocks of one page in one folder.

    Parameters
    ----------
    folder
        Empty, and made by the caller.
    name
        The page's, for messages.
    """

    folder: Path
    name: str = "page"
    namespace: dict[str, Any] = field(default_factory=lambda: {"__name__": "__page__"})

    def run(self, block: Block) -> str:
        """Run a block, or write its file, and return what it printed.

        Parameters
        ----------
        block
            Of kind ``run`` or ``file``.

        Raises
        ------
        PageError
            If it ends with another exit code than it should.
        """
        if block.kind == "file":
            path = self.folder / block.note
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text + "\n", encoding="utf-8")
            return ""
        return self._bash(block) if block.language == "bash" else self._python(block)

    def _bash(self, block: Block) -> str:
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
        done = subprocess.run(
            ["bash", "-e", "-c", block.text],
            cwd=self.folder,
            env=os.environ | {"PATH": path, "COLUMNS": "100"},
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            check=False,
        )
        if done.returncode != block.exit_code:
            raise PageError(
                f"{self.name}, line {block.line}: exit code {done.returncode}, expected "
                f"{block.exit_code}\n{block.text}\n{done.stdout}{done.stderr}"
            )
        return done.stdout

    def _python(self, block: Block) -> str:
        printed = io.StringIO()
        # Lines before the block are left empty, so that a traceback names the page's line.
        code = compile("\n" * block.line + block.text, self.name, "exec", dont_inherit=True)
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(printed):
            exec(code, self.namespace)
        return printed.getvalue()


def run_page(page: str, runner: Runner) -> Iterator[tuple[Block, str]]:
    """Run a page's blocks and yield each output block with what was actually printed.

    Parameters
    ----------
    page
        Its Markdown.
    runner
        Where.
    """
    printed: str | None = None
    for block in parse(page):
        if block.kind in ("run", "file"):
            text = runner.run(block)
            printed = text if block.kind == "run" else printed
        elif block.kind == "left out":
            printed = None
        elif block.kind == "output" and printed is not None:
            yield block, printed


def agrees(shown: str, printed: str) -> bool:
    """Tell whether a shown output is what was printed; ``...`` stands for anything.

    Parameters
    ----------
    shown, printed
        The page's text, and the real one.

    Examples
    --------
    >>> agrees("wrote ...", "wrote result/plot.png")
    True
    """
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    return doctest.OutputChecker().check_output(shown.strip() + "\n", printed.strip() + "\n", flags)


def update_page(path: Path) -> bool:
    """Rewrite the outputs of a page that no longer agree; return whether there were any.

    Parameters
    ----------
    path
        Of the page.
    """
    page = path.read_text(encoding="utf-8")
    lines = page.splitlines()
    with tempfile.TemporaryDirectory() as folder:
        shown = list(run_page(page, Runner(Path(folder), path.name)))
    stale = [
        (block, printed)
        for block, printed in shown
        if block.text == "..." or not agrees(block.text, printed)
    ]
    for block, printed in reversed(stale):
        end = block.line + len(block.text.splitlines())
        lines[block.line : end] = printed.strip("\n").splitlines()
    if stale:
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return bool(stale)


def main() -> None:
    """Update pages, or list what does not run in them."""
    parser = argparse.ArgumentParser(description="Run the code blocks of Markdown pages.")
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("--update", action="store_true", help="rewrite their outputs")
    action.add_argument("--list", action="store_true", help="name the blocks that do not run")
    parser.add_argument("pages", nargs="+", type=Path)
    options = parser.parse_args()
    for path in options.pages:
        if options.list:
            for block in parse(path.read_text(encoding="utf-8")):
                if block.kind == "left out":
                    sys.stdout.write(f"{path}:{block.line}: {block.note}\n")
        else:
            sys.stdout.write(f"{path}: {'updated' if update_page(path) else 'unchanged'}\n")


if __name__ == "__main__":
    main()
