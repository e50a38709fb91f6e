"""The fit gives back what logs were simulated with, and says what it cannot tell."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.scene import RangeLog, Scene
from gaia_uwb.simulate import PRESETS, simulate
from gaia_uwb.simulate.presets import load_preset
from gaia_uwb.simulate.reality.fit import fit_ranging, preset_text
from gaia_uwb.simulate.settings import ClosureConfig, DriveConfig, PassConfig, RangingConfig

KNOWN = RangingConfig(
    bias_m=0.05,
    bias_per_decade_m=0.2,
    drift_sigma_m=0.08,
    drift_correlation_s=3.0,
    own_drift_sigma_m=0.06,
    own_drift_correlation_s=12.0,
    sigma_m=0.03,
    sigma_per_m=0.0,
    averaged=3,
    dropout_share=0.05,
    outage_per_s=0.05,
    outage_s=1.0,
    held_share=0.0,
    los_s=20.0,
    nlos_s=10.0,
    nlos_bias_m=0.15,
    nlos_bias_sigma_m=0.05,
    nlos_bias_correlation_s=12.0,
    burst_per_s=0.03,
    burst_lengths=(0.0, 0.5, 0.5),
    burst_negative_share=0.8,
    burst_median_m=5.0,
    burst_log_sigma=0.5,
    burst_max_m=30.0,
    clock_offset_s=0.12,
    rssi_per_decade_db=6.0,
)


@pytest.fixture(scope="module")
def logs() -> list[Scene]:
    drive = DriveConfig(duration_s=300.0, speed_mps=1.0, position_sigma_m=0.0, lane_change=False)
    config = PassConfig(
        closure=ClosureConfig(n_anchors=6, work_m=10.0, buffer_m=5.0), drive=drive, ranging=KNOWN
    )
    return list(simulate(config, 6, seed=11))


@pytest.fixture(scope="module")
def fitted(logs: list[Scene]) -> RangingConfig:
    return fit_ranging(logs)


@pytest.mark.parametrize(
    ("setting", "tolerance"),
    [
        ("rate_hz", 0.2), ("dropout_share", 0.01), ("outage_per_s", 0.02), ("outage_s", 0.35),
        ("held_share", 0.005), ("bias_m", 0.03), ("bias_per_decade_m", 0.05),
        ("drift_sigma_m", 0.02), ("drift_correlation_s", 1.5), ("own_drift_sigma_m", 0.015),
        ("own_drift_correlation_s", 6.0), ("sigma_m", 0.008), ("sigma_per_m", 0.0005),
        ("averaged", 1), ("los_s", 6.0), ("nlos_s", 3.0), ("nlos_bias_m", 0.03),
        ("nlos_bias_sigma_m", 0.05), ("burst_per_s", 0.006), ("burst_negative_share", 0.08),
        ("burst_median_m", 0.6), ("burst_log_sigma", 0.1), ("clock_offset_s", 1e-9),
        ("rssi_at_1m_dbm", 0.3), ("rssi_per_decade_db", 0.3), ("rssi_sigma_db", 0.1),
        ("nlos_first_path_loss_db", 0.3),
    ],
)  # fmt: skip
def test_simulated_logs_give_their_settings_back(
    fitted: RangingConfig, setting: str, tolerance: float
) -> None:
    # Outages come out a little long: those of one or two polls count as dropouts.
    assert getattr(fitted, setting) == pytest.approx(getattr(KNOWN, setting), abs=tolerance)


def test_burst_lengths_are_found(fitted: RangingConfig) -> None:
    lengths = np.array(fitted.burst_lengths)
    assert lengths.sum() == pytest.approx(1.0)
    # A dropout shortens some bursts by a reading.
    assert lengths[:3] == pytest.approx([0.0, 0.5, 0.5], abs=0.12)


def test_without_labels_sight_is_never_lost(logs: list[Scene]) -> None:
    blind = [replace(log, truth=replace(log.truth, nlos=None)) for log in logs[:2]]
    assert fit_ranging(blind).los_s is None


def test_labels_that_never_change_give_the_share_only(logs: list[Scene]) -> None:
    labelled = []
    for log, blocked in zip(logs[:4], (True, False, False, False), strict=True):
        nlos = np.full(len(log.ranges), blocked)
        labelled.append(replace(log, truth=replace(log.truth, nlos=nlos)))
    assert fit_ranging(labelled).nlos_share == pytest.approx(0.25, abs=0.02)


def test_logs_without_power_or_bursts_keep_defaults(logs: list[Scene]) -> None:
    log = logs[0]
    clean = RangeLog(log.ranges.t_s, log.ranges.anchor, log.truth.range_m)
    found = fit_ranging([replace(log, ranges=clean)])
    assert found.burst_per_s == 0.0
    assert found.rssi_at_1m_dbm == RangingConfig().rssi_at_1m_dbm
    assert found.sigma_m < 0.01
    assert abs(found.bias_m) < 0.01


def test_the_preset_is_read_back(fitted: RangingConfig, logs: list[Scene], tmp_path: Path) -> None:
    path = tmp_path / "fitted.yaml"
    path.write_text(preset_text(fitted, logs, "1.2.3"), encoding="utf-8")
    assert load_preset(path) == PassConfig(ranging=fitted)
    head = path.read_text(encoding="utf-8").splitlines()
    assert "gaia 1.2.3" in head[0]
    assert head[1] == f"#   {logs[0].name}"


def test_too_little_to_fit() -> None:
    short = PassConfig(
        closure=ClosureConfig(n_anchors=1),
        drive=DriveConfig(duration_s=2.0, speed_mps=1.0),
        ranging=RangingConfig(max_range_m=500.0),
    )
    with pytest.raises(InputError, match="at least 100 ranges"):
        fit_ranging(list(simulate(short, 1, seed=0)))


def test_a_survey_is_needed() -> None:
    with pytest.raises(InputError, match="expected surveyed anchors"):
        fit_ranging([log.without_truth() for log in simulate(PRESETS["parked"], 1, seed=0)])
