"""The report says in plain words what is in the reconstruction, and nothing else."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from markdown_it import MarkdownIt

from factories import HOSTILE, SQUARE_M, make_fix, make_reason, make_reconstruction, make_unlocated
from gaia_uwb.api import load_scenes
from gaia_uwb.config import make_config
from gaia_uwb.episode import ClockOffset
from gaia_uwb.estimate import AnchorStatus, ReasonKind, SideSource
from gaia_uwb.evaluate.advice import Advice
from gaia_uwb.outputs.plain_words import people_report
from gaia_uwb.pipeline import reconstruct
from gaia_uwb.reconstruction import Reconstruction, ReconstructionStatus
from gaia_uwb.scene import RangeLog, Scene, Trajectory
from gaia_uwb.simulate import PRESETS, simulate_pass
from gaia_uwb.zone.uncertainty import Region

JARGON = re.compile(
    r"\b(covarian|sigma|converge|ill-condition|hypothes|solver|multilaterat|mirror|"
    r"posterior|NLOS\b|LOS\b|nan\b|(?-i:None\b))", re.IGNORECASE,
)  # fmt: skip
SECTIONS = [
    "What was found", "Confidence", "Limitations", "How to improve the result", "The cones",
]  # fmt: skip
NOTES = "How the log was read"


def sections(report: str) -> dict[str, str]:
    """Return the report's parts by their headings; the first part has none."""
    first, *others = re.split(r"^## (.*)\n", report, flags=re.MULTILINE)
    return {"": first, **dict(zip(others[::2], others[1::2], strict=True))}


def read(reconstruction: Reconstruction) -> dict[str, str]:
    """Write a report and see that it is whole, plain and renders as it looks."""
    report = people_report(reconstruction)
    assert JARGON.search(report.split("\n", 1)[1]) is None  # a name may be anything
    parts = sections(report)
    noted = [NOTES] if reconstruction.notes else []
    assert list(parts) == ["", *SECTIONS[:-1], *noted, SECTIONS[-1]]
    tokens = MarkdownIt("commonmark", {"html": True}).enable("table").parse(report)
    kinds = {t.type for token in tokens for t in (token, *(token.children or []))}
    assert not kinds & {"html_block", "html_inline", "link_open", "image", "em_open", "fence"}
    heads = [t for t in tokens if t.type == "heading_open"]
    assert [h.tag for h in heads] == ["h1", *["h2"] * (5 + len(noted))]
    return parts


def table(part: str) -> list[list[str]]:
    rows = [line for line in part.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]] for row in rows]


def test_ideal_run() -> None:
    reconstruction = make_reconstruction()
    episode = replace(
        reconstruction.episode, tag_up_m=np.full(200, 1.0), anchor_up_m=np.full(4, 1.0)
    )
    parts = read(replace(reconstruction, episode=episode))
    assert "**Reliable.** All 4 cones were located. The work zone covers 12.0 m²." in parts[""]
    assert "4 corners and is 5.00 m long at its longest" in parts["What was found"]
    assert "The drive covered 45.0 m in 19.9 s and used 720 ranges" in parts["What was found"]
    sure = parts["Confidence"]
    assert "The 90 % error radius is 0.45 m for the median cone" in sure
    assert "has less than 1 % probability (cone-0)" in sure
    assert "0.180 s ahead of those of the positions" in sure
    assert "This was corrected, to ± 0.016 s (90 %)." in sure
    assert "The ranges were 0.10 m too long at 10 m" in sure
    assert parts["Limitations"].strip().startswith("No check found one.")
    assert (
        parts["How to improve the result"].strip() == "Nothing in this log calls for another drive."
    )
    head, _, *rows = table(parts["The cones"])
    assert head[:6] == ["Cone", "Status", "East (m)", "North (m)", "Latitude (°)", "Longitude (°)"]
    assert rows[1][:6] == ["cone-1", "located", "4.00", "0.00", "48.1000000", "11.5000537"]
    assert rows[1][6:9] == ["0.45", "more than 99 %", "180"]


def test_the_report_says_what_decides_the_sides() -> None:
    sources = [SideSource.RANGES, SideSource.LAYOUT, SideSource.RANGES, SideSource.RANGES]
    fixes = {k: make_fix(f"cone-{k}", SQUARE_M[k], side_source=s) for k, s in enumerate(sources)}
    sure = read(make_reconstruction(changed=fixes))["Confidence"]
    assert (
        "Sides are decided: 3 by the cones' own ranges alone and 1 only with what is known of work "
        "zones."
    ) in sure
    for k, source in enumerate((SideSource.STATEMENT, SideSource.OPEN)):
        fixes[k] = make_fix(f"cone-{k}", SQUARE_M[k], side_source=source)
    sure = read(make_reconstruction(changed=fixes))["Confidence"]
    assert (
        "2 by the cones' own ranges alone, 0 only with what is known of work zones, 1 only with "
        "what was stated and 1 not at all."
    ) in sure


def test_numbers_of_the_fit_are_those_of_the_ranges() -> None:
    reconstruction = make_reconstruction()
    exact_m = np.hypot(*(reconstruction.episode.position_m[:, None] - SQUARE_M).transpose(2, 0, 1))
    error_m = np.abs(reconstruction.episode.range_m - exact_m - 0.05)
    half_m, most_m = np.nanquantile(error_m, [0.5, 0.95])
    sure = read(reconstruction)["Confidence"]
    assert f"fit these positions within {half_m:.2f} m, and 95 % within {most_m:.2f} m." in sure


def test_straight_run() -> None:
    parts = read(reconstruct(simulate_pass(PRESETS["straight"], seed=4)))
    assert parts[""].count("**Needs review.**") == 1
    assert "- the side of the path is uncertain for all 8 cones" in parts[""]
    assert "The side of the path is uncertain for all 8 cones" in parts["Limitations"]
    assert "The path was straight" in parts["Limitations"]
    steps = parts["How to improve the result"]
    for advice in (Advice.SECOND_DRIVE, Advice.WEAVE, Advice.STATE_SIDE, Advice.SURVEY):
        assert advice in steps
    assert steps.index(Advice.SECOND_DRIVE) < steps.index(Advice.WEAVE)
    rows = table(parts["The cones"])[2:]
    others = [row for row in rows if row[1] == "other position"]
    assert others
    for row in others:
        chosen = next(r for r in rows if r[0] == row[0] and r[1] == "side uncertain")
        shares = [int(re.sub(r"\D", "", r[7])) for r in (chosen, row)]
        assert sum(shares) == pytest.approx(100, abs=1)


def test_run_that_hardly_moved() -> None:
    rng = np.random.default_rng(3)
    t_s = np.arange(0.0, 20.0, 0.1)
    path_m = np.stack([np.linspace(0.0, 1.5, 200), np.zeros(200)], axis=1)
    cones_m = np.array([[10.0, 6.0], [14.0, 6.0], [14.0, 9.0]])
    range_m = np.hypot(*(path_m[:, None] - cones_m).transpose(2, 0, 1))
    range_m = range_m + 0.05 * rng.standard_normal(range_m.shape)
    step, anchor = np.divmod(np.arange(600), 3)
    log = RangeLog(t_s[step], anchor, range_m[step, anchor])
    scene = Scene("hardly", Trajectory(t_s, path_m), log, ("a", "b", "c"))
    parts = read(reconstruct(scene))
    assert "Needs review" in parts[""]
    limited = parts["Limitations"]
    assert "The vehicle only moved within 1.50 m" in limited
    assert "The side of the path is uncertain" in limited
    assert Advice.LONGER in parts["How to improve the result"]
    assert "The log has no geographic reference" in parts["What was found"]
    assert len(table(parts["The cones"])[0]) == 8


def test_run_with_few_cones() -> None:
    changed = {0: make_unlocated("cone-0"), 1: make_unlocated("cone-1")}
    parts = read(make_reconstruction(changed=changed))
    assert "2 of 4 cones were located. That is too few for a boundary." in parts[""]
    assert "Not located: cone-0, cone-1." in parts["What was found"]
    assert "corners" not in parts["What was found"]
    assert "No position was found for cone-0 and cone-1" in parts["Limitations"]
    assert Advice.CHECK_RADIOS in parts["How to improve the result"]
    assert table(parts["The cones"])[2] == [
        "cone-0", "not located", "", "", "", "", "", "", "2", "",
    ]  # fmt: skip


def test_run_without_any_cone() -> None:
    changed = {k: make_unlocated(f"cone-{k}") for k in range(4)}
    parts = read(make_reconstruction(changed=changed))
    assert "0 of 4 cones were located" in parts[""]
    assert "90 % error radius" not in parts["Confidence"]
    assert "Half of the ranges" not in parts["Confidence"]


def test_real_run(outdoor_dir: Path) -> None:
    (scene,) = load_scenes("outdoor-uwb:NLOS/B/4", data_dir=outdoor_dir)
    result = reconstruct(scene.without_truth())
    parts = read(result)
    assert "**Reliable.** All 4 cones were located." in parts[""]
    assert "178.1 s" in parts["What was found"]
    assert "s ahead of those" in parts["Confidence"]
    regions = result.boundary_uncertainty
    assert regions is not None
    assert (
        f"A region of {regions.inner.area_m2:.1f} m² lies inside the work zone with 90 % confidence"
        in parts["Confidence"]
    )
    assert f"lies within a region of {regions.outer.area_m2:.1f} m²" in parts["Confidence"]
    rows = table(parts["The cones"])[2:]
    assert [row[0] for row in rows] == [*result.episode.anchor_ids]
    for row, anchor in zip(rows, result.anchors, strict=True):
        assert [float(row[2]), float(row[3])] == pytest.approx(anchor.position_m, abs=0.0051)


def test_what_was_said_is_told_as_such() -> None:
    scene = simulate_pass(PRESETS["straight"], seed=4)
    told = read(reconstruct(scene, make_config({"prior": {"side": "left"}})))
    assert "stated about the zone was used: all cones are on the left." in told["Confidence"]
    wrong = read(reconstruct(simulate_pass(PRESETS["lane-closure"], seed=0),
                             make_config({"prior": {"side": "left"}})))  # fmt: skip
    assert "stated about the zone" not in wrong["Confidence"]
    assert 'The ranges contradict "all cones are on the left"' in wrong["Limitations"]
    assert wrong["How to improve the result"].strip().startswith(f"1. {Advice.CHECK_STATEMENT}")


@pytest.mark.parametrize("status", [s for s in AnchorStatus if s.has_position])
def test_every_status_has_words(status: AnchorStatus) -> None:
    changed = {0: make_fix("cone-0", SQUARE_M[0], status=status)}
    text = people_report(make_reconstruction(changed=changed))
    assert any(line.startswith("| cone-0 |") for line in text.splitlines())


def test_no_region_is_sure() -> None:
    result = reconstruct(simulate_pass(PRESETS["straight"], seed=3))
    known = result.boundary_uncertainty
    assert known is not None
    nothing = replace(known, inner=Region((), 0.0))
    result.__dict__["boundary_uncertainty"] = nothing
    sure = read(result)["Confidence"]
    assert "No area can be called work zone with 90 % confidence; the whole zone lies" in sure


def test_reasons_that_no_check_knows_are_passed_on() -> None:
    unreliable = replace(
        make_reconstruction(),
        status=ReconstructionStatus.UNRELIABLE,
        reasons=(
            make_reason("83 % of the path lies outside the area of its *training*"),
            make_reason("cone-1: any words", ReasonKind.AMBIGUOUS),
        ),
    )
    first = sections(people_report(unreliable))[""]
    assert r"- 83 % of the path lies outside the area of its \*training\*" in first
    assert "cone-1: any" not in first


def test_clock_that_was_not_corrected() -> None:
    clock = ClockOffset(0.0, 0.5, applied=False, reason="this drive cannot tell it")
    reconstruction = make_reconstruction()
    parts = read(replace(reconstruction, episode=replace(reconstruction.episode, clock=clock)))
    assert (
        "used as they are. They may differ by ± 0.823 s (90 %): this drive cannot"
        in parts["Confidence"]
    )
    assert Advice.ONE_CLOCK in parts["How to improve the result"]


def test_hostile_ids_stay_text() -> None:
    changed = {
        0: make_fix(HOSTILE[0], SQUARE_M[0], status=AnchorStatus.AMBIGUOUS, mirror_probability=0.4),
        1: make_fix(HOSTILE[1], SQUARE_M[1], status=AnchorStatus.ILL_CONDITIONED),
        3: make_unlocated(HOSTILE[3]),
    }
    reconstruction = make_reconstruction(anchor_ids=HOSTILE, changed=changed, name=HOSTILE[2])
    parts = read(replace(reconstruction, reasons=(make_reason(f"{HOSTILE[0]}: lost"),),
                         status=ReconstructionStatus.UNRELIABLE))  # fmt: skip
    rows = table(parts["The cones"])
    assert {len(row) for row in rows} == {10}
    assert len(rows) == 2 + 4 + 1


def test_several_passes_are_told_one_by_one() -> None:
    near = make_reconstruction()
    clock = ClockOffset(offset_s=-0.3, sigma_s=0.02, applied=True, reason="told from 0")
    other = replace(near.episode, name="second *drive*", clock=clock)
    text = people_report(replace(near, more_passes=((other, near.denoised),)))
    assert text.startswith("# Work zone: a drive and 1 more\n")
    assert "2 passes were combined: a drive (45.0 m in 19.9 s); second" in text
    assert "In a drive: The time stamps of the ranges were 0.180 s ahead of" in text
    assert r"In second \*drive\*: The time stamps of the ranges were 0.300 s behind those" in text


def test_a_limit_of_one_pass_names_it_and_a_common_one_is_said_once() -> None:
    near = make_reconstruction()
    biased = replace(near.episode.calibration, bias=np.array([0.7, 0.0]))
    other = replace(near.episode, name="second", calibration=biased)
    alone = people_report(near)
    text = people_report(replace(near, more_passes=((other, near.denoised),)))
    assert "In second: All ranges are 0.70 m too long" in text
    for line in alone.partition("## Limitations")[2].partition("## The cones")[0].splitlines():
        assert text.count(line) >= 1
        if line.startswith("- "):
            assert text.count(line) == 1


def test_the_notes_of_the_reader_are_shown_as_text_and_left_out_where_there_are_none() -> None:
    plain = make_reconstruction()
    noted = replace(plain, episode=replace(plain.episode, notes=("uwb.csv: skipped <b>3</b>",)))
    assert "How the log was read" not in people_report(plain)
    assert sections(people_report(noted))["How the log was read"].strip() == (
        "- uwb.csv: skipped \\<b\\>3\\</b\\>"
    )
