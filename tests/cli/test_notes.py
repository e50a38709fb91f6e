"""What the reader noted is shown wherever a result is shown."""

import json
from pathlib import Path

from gaia_uwb.logs import write_native
from gaia_uwb.simulate import PRESETS, simulate_pass


def test_reconstruct_shows_the_notes_of_data_check(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    folder, out = tmp_path / "log", tmp_path / "out"
    write_native(simulate_pass(PRESETS["lane-closure"], seed=0).without_truth(), folder)
    ranges = folder / "ranges.csv"
    header, *rows = ranges.read_text(encoding="utf-8").splitlines()
    rows = [f"{row},x" for row in rows]
    ranges.write_text("\n".join([f"{header},colour", *rows]), encoding="utf-8")
    _, checked, _ = run("data", "check", folder)
    code, said, _ = run("reconstruct", folder, "--out", out)
    note = "ranges.csv: ignored columns: colour"
    assert f"note: {note}\n" in checked
    assert (code, f"note: {note}\n" in said) == (0, True)
    assert json.loads((out / "report.json").read_text(encoding="utf-8"))["notes"] == [note]
    assert f"- {note}\n" in (out / "report.md").read_text(encoding="utf-8")
    assert note in (out / "map.html").read_text(encoding="utf-8")


def test_a_radio_that_shares_its_id_is_not_called_reliable(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    folder = tmp_path / "log"
    write_native(simulate_pass(PRESETS["lane-closure"], seed=0).without_truth(), folder)
    (folder / "anchors.csv").unlink()
    ranges = folder / "ranges.csv"
    text = ranges.read_text(encoding="utf-8")
    ranges.write_text(text.replace("cone-3", "cone-1"), encoding="utf-8")
    code, said, _ = run("reconstruct", folder, "--out", tmp_path / "out")
    assert code == 1
    assert "reason: cone-1: the readings do not come from one place" in said
