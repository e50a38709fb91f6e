from __future__ import annotations

from gaia_uwb.logs.registry import REGISTRY, import_function


def test_every_entry_names_functions_that_exist() -> None:
    for entry in REGISTRY.values():
        assert callable(import_function(entry.loader))
        assert entry.checker is None or callable(import_function(entry.checker))
        assert all([entry.description, entry.parts, entry.licence, entry.citation])
