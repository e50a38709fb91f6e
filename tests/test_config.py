"""Settings: strict, frozen, and the same after a round trip through YAML."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from hypothesis import given, strategies as st
from pydantic import ValidationError

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.config import (
    AlignmentConfig,
    PipelineConfig,
    SolverConfig,
    dump_config,
    load_config,
    make_config,
)


def write(folder: Path, text: str | bytes) -> Path:
    path = folder / "settings.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_settings_are_frozen() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        PipelineConfig().denoiser = "raw"  # type: ignore[misc]  # the point of the test


def test_a_file_changes_what_it_names_and_nothing_else(tmp_path: Path) -> None:
    path = write(tmp_path, "denoiser: median\nalignment:\n  max_gap_s: 2\n")
    config = load_config(path)
    assert config == PipelineConfig(denoiser="median", alignment=AlignmentConfig(max_gap_s=2.0))


@pytest.mark.parametrize("text", ["", "# only a comment\n", "{}"])
def test_an_empty_file_gives_the_defaults(tmp_path: Path, text: str) -> None:
    assert load_config(write(tmp_path, text)) == PipelineConfig()


@given(
    gap=st.floats(min_value=1e-300, max_value=60),
    dof=st.floats(min_value=1, max_value=100),
    gate=st.booleans(),
    resample=st.sampled_from(["linear", "nearest"]),
)
def test_yaml_round_trip(gap: float, dof: float, gate: bool, resample: str) -> None:
    import yaml

    config = PipelineConfig(
        alignment=AlignmentConfig(max_gap_s=gap, gate=gate, resample=resample),
        solver=SolverConfig(kind="wls", student_t_dof=dof),
    )
    assert make_config(yaml.safe_load(dump_config(config))) == config


def test_the_longest_gap_may_be_left_to_the_log(tmp_path: Path) -> None:
    path = write(tmp_path, "alignment:\n  max_gap_s: auto\n")
    assert load_config(path) == PipelineConfig()
    assert "max_gap_s: auto" in dump_config(PipelineConfig())


def test_round_trip_through_a_file(tmp_path: Path) -> None:
    config = PipelineConfig(denoiser="kalman")
    assert load_config(write(tmp_path, dump_config(config))) == config


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"denoisr": "raw"}, "denoisr: unknown key"),
        ({"alignment": {"max_gap": 1.0}}, "alignment.max_gap: unknown key"),
        ({"alignment": {"max_gap_s": 0}}, "alignment.max_gap_s: input should be greater than 0"),
        ({"alignment": {"max_gap_s": 61.0}}, "less than or equal to 60, got 61.0"),
        ({"alignment": {"max_clock_offset_s": 0.0}}, "greater than or equal to 0.1, got 0.0"),
        ({"alignment": {"max_gap_s": "long"}}, "alignment.max_gap_s: input should be a valid num"),
        ({"alignment": {"max_gap_s": "1"}}, "should be a valid number, got '1'"),
        ({"alignment": {"max_gap_s": float("nan")}}, "finite number, got nan"),
        ({"alignment": {"gate": 1}}, "alignment.gate: input should be a valid boolean, got 1"),
        ({"alignment": {"resample": "cubic"}}, "'linear' or 'nearest', got 'cubic'"),
        ({"solver": {"min_ranges": 2}}, "solver.min_ranges: input should be greater than or"),
        ({"sides": {"ambiguous_above": 0.5}}, "sides.ambiguous_above: input should be less than"),
        ({"solver": None}, "solver: input should be a valid dictionary"),
        ([1, 2], "top level: input should be a valid dictionary"),
        ("pose-kalman", "top level: input should be a valid dictionary"),
        ({3: 4}, "keys should be strings"),
    ],
)
def test_impossible_settings(content: object, message: str) -> None:
    with pytest.raises(ConfigError, match=f"^the file: .*{re.escape(message)}"):
        make_config(content, source="the file")


def test_all_problems_in_one_line() -> None:
    with pytest.raises(ConfigError) as caught:
        make_config({"a": 1, "solver": {"min_ranges": 0, "kind": "best"}})
    text = str(caught.value)
    assert "\n" not in text
    for name in ("a: ", "solver.min_ranges: ", "solver.kind: "):
        assert name in text


def test_many_or_endless_problems_are_told_in_part() -> None:
    with pytest.raises(ConfigError) as caught:
        make_config({f"k{n}": n for n in range(2000)} | {"alignment": {"a\nb" * 9000: 1}})
    text = str(caught.value)
    assert text.endswith("; and 1996 more")
    assert len(text) < 1000
    assert "\n" not in text


@pytest.mark.parametrize(
    "text",
    [
        "a: [1, 2",
        "a: b: c",
        b"\xff\xfe\xfa",
        "a: 2024-13-45",
        "[" * 5000,
        "!!python/object:os.system {}",
    ],
)
def test_files_that_are_no_settings(tmp_path: Path, text: str | bytes) -> None:
    with pytest.raises(ConfigError, match=r"settings\.yaml: cannot read settings: ") as caught:
        load_config(write(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_a_key_twice_names_its_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="line 2: duplicate key 'denoiser'"):
        load_config(write(tmp_path, "denoiser: raw\ndenoiser: median"))


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.yaml: cannot read settings: .*No such file"):
        load_config(tmp_path / "nowhere.yaml")
    with pytest.raises(ConfigError, match="cannot read settings"):
        load_config(tmp_path)


def test_a_pipe_is_no_settings_file_and_does_not_hang(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    with pytest.raises(ConfigError, match=r"cannot read settings: .*not a regular file"):
        load_config(tmp_path / "pipe.yaml")


@pytest.mark.parametrize(
    "name, value", [("min_ranges", 10**21), ("ill_conditioned_above_m", 1e300)]
)
def test_settings_too_large_to_compute_with_are_refused(name: str, value: float) -> None:
    with pytest.raises(ConfigError, match=f"settings: solver.{name}: "):
        make_config({"solver": {name: value}})
