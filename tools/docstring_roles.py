"""Turn the roles of our docstrings into the site's cross-references.

``:func:`reconstruct``` and the like are what editors and Sphinx know; the site knows elements
``<autoref>``. One whose target the site does not show stays code.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import griffe

_ROLE = re.compile(r":(?:func|class|data|mod|attr|meth|exc):`(~?)([\w.]+)`")


class DocstringRoles(griffe.Extension):
    """Rewrites the docstrings of a package once it has been read."""

    def on_package(self, *, pkg: griffe.Module, **kwargs: Any) -> None:
        """Rewrite all docstrings of a package.

        Parameters
        ----------
        pkg
            The package.
        **kwargs
            What griffe passes on.
        """
        for each in _walk(pkg):
            if each.docstring:
                each.docstring.value = with_references(each.docstring.value, each)


def with_references(text: str, scope: griffe.Object) -> str:
    """Return a docstring with references instead of roles.

    Parameters
    ----------
    text
        The docstring.
    scope
        The object that it documents; names are looked up from there.
    """

    def reference(role: re.Match[str]) -> str:
        short, name = role[1], role[2]
        try:
            target = name if name.startswith("gaia_uwb.") else scope.resolve(name)
        except griffe.NameResolutionError:
            target = name
        shown = name.rpartition(".")[2] if short else name
        return f'<autoref optional identifier="{target}"><code>{shown}</code></autoref>'

    return _ROLE.sub(reference, text)


def _walk(scope: griffe.Object) -> Iterator[griffe.Object]:
    yield scope
    for member in scope.members.values():
        if isinstance(member, griffe.Object):
            yield from _walk(member)
