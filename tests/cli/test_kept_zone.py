"""``gaia reconstruct --zone``: drives are added to a zone that is kept."""

from __future__ import annotations

import json
from pathlib import Path

from gaia_uwb.kept import Zone


def test_a_log_is_added_to_the_zone(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    options = ("--zone", tmp_path / "zone", "--denoiser", "raw", "--out", tmp_path / "out")
    assert run("reconstruct", "sim:lane-closure/1", *options)[0] == 0
    assert run("reconstruct", "sim:lane-closure/2", *options)[0] in (0, 1)  # it is another zone
    assert len(Zone.open(tmp_path / "zone").drives) == 2
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert len(report["passes"]) == 2


def test_the_same_log_does_not_count_twice(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    options = ("--zone", tmp_path / "zone", "--denoiser", "raw", "--out", tmp_path / "out")
    run("reconstruct", "sim:lane-closure/1", *options)
    code, _, err = run("reconstruct", "sim:lane-closure/1", *options)
    assert code == 2
    assert "is in the zone already" in err


def test_settings_of_a_zone_stay(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    options = ("--zone", tmp_path / "zone", "--out", tmp_path / "out")
    run("reconstruct", "sim:lane-closure/1", *options, "--denoiser", "raw")
    code, _, err = run("reconstruct", "sim:lane-closure/2", *options, "--denoiser", "pose-kalman")
    assert code == 2
    assert "was made with other settings, which stay" in err
