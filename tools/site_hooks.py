"""Hooks of MkDocs: pages generated from the code, so that none is typed by hand.

``mkdocs.yml`` names this file under ``hooks``.
"""

from __future__ import annotations

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from command_reference import command_page
from settings_reference import settings_page

_GENERATED = {
    "reference/command-line.md": command_page,
    "reference/settings.md": settings_page,
}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages.

    Parameters
    ----------
    files
        Those of the folder ``docs``.
    config
        Of the site.
    """
    for name, make in _GENERATED.items():
        files.append(File.generated(config, name, content=make()))
    return files
