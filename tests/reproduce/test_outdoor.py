"""No model is scored on ranges that it was trained or chosen on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gaia_uwb.reproduce import outdoor
from gaia_uwb.reproduce.outdoor import alignment_tables
from gaia_uwb.reproduce.plan import CLASSICAL, VARIANTS
from tiny import TINY, make_workshop


@pytest.mark.parametrize(
    ("split", "length"),
    [("window", 64), ("window", 128), ("window", None), ("run", None), ("layout", 64)],
)
def test_every_step_is_denoised_by_a_model_that_has_not_seen_it(
    tmp_path: Path, split: str, length: int | None
) -> None:
    workshop = make_workshop(tmp_path, replace(TINY, splits=(split,), n_layouts=2))
    runs = workshop.runs("aligned")
    seen: dict[str, set[tuple[str, float]]] = {}
    for training in outdoor.outdoor_trainings(workshop):
        sets = training.data.sets(training.recipe.sets)
        seen[training.denoiser] = {
            (name.partition("[")[0], t)
            for episode in (*sets.training, *sets.validation)
            for name in [episode.name]
            for t, there in zip(episode.t_s, episode.valid.any(axis=1), strict=True)
            if there
        }
    cut = outdoor._cut(runs, length)
    rows = [(m, s) for m, s, _ in outdoor._sources(workshop, "aligned") if m.network is not None]
    assert {name for _, name in rows} == {split}
    for method, own_split, sources in outdoor._sources(workshop, "aligned"):
        if method.network is None:
            continue
        for episode, pieces in zip(cut.episodes, outdoor._pieces(cut, sources[0]), strict=True):
            assert own_split == split
            for piece in pieces:
                run = episode.name.partition("[")[0]
                read = {
                    (run, t)
                    for t, there in zip(
                        episode.t_s[piece.start : piece.stop],
                        episode.valid[piece.start : piece.stop].any(axis=1),
                        strict=True,
                    )
                    if there
                }
                assert not read & seen[piece.denoiser], (episode.name, piece)


def test_alignment_tables_have_a_row_per_method(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(outdoor, "VARIANTS", VARIANTS[:1])
    (table,) = alignment_tables(make_workshop(tmp_path)).values()
    assert [row.method for row in table.rows] == list(CLASSICAL)
    assert table.protocol["settings"] == {}
    assert len(table.episodes) == 8
