"""The command line's reference page, from the Typer app itself."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import typer
from typer.cli import get_docs_for_click
from typer.main import get_command

from gaia_uwb.cli import app

_HEAD = """# The command line

Generated from the commands themselves; `gaia COMMAND --help` prints the same text.

Exit codes: 0 done; 1 done, but a result is marked unreliable; 2 bad input or usage, with one line
on stderr. Results are written to `--out`, each file whole or not at all.

"""


def command_page() -> str:
    """Return the page's Markdown.

    Examples
    --------
    >>> page = command_page()
    >>> "## `gaia reconstruct`" in page, "to go on..." in page
    (True, False)
    """
    command = get_command(app)
    body = get_docs_for_click(obj=command, ctx=typer.Context(command, info_name="gaia"))
    body = body[body.index("**Usage**") :]  # the page has its own heading
    body = re.sub(r"^\* `--help`: .*\n", "", body, flags=re.MULTILINE)
    for name, text in _helps(command):  # Typer's lists of commands cut long sentences short
        body = re.sub(rf"^\* `{name}`: .*\.\.\.$", f"* `{name}`: {text}", body, flags=re.MULTILINE)
    return _HEAD + body


def _helps(command: Any) -> Iterator[tuple[str, str]]:
    """Yield each command's name and the first sentence of its help."""
    for name, inner in getattr(command, "commands", {}).items():
        yield name, " ".join((inner.help or "").partition("\n\n")[0].split())
        yield from _helps(inner)
