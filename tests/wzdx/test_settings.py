"""Settings of feeds: strict, with every problem in one line."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta, timezone
from pathlib import Path

import pytest

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.wzdx import load_feed_config, make_feed_config
from wzdx_cases import CONFIG, CWZ, FEED_YAML


def test_yaml_dates_and_texts_are_the_same(tmp_path: Path) -> None:
    path = tmp_path / "feed.yaml"
    path.write_text(FEED_YAML)
    config = load_feed_config(path)
    assert config.end_date == datetime(2026, 11, 22, 17, tzinfo=UTC)
    path.write_text(FEED_YAML.replace("2026-11-22T09:00:00Z", '"2026-11-22T09:00:00Z"'))
    assert load_feed_config(path) == config
    cwz = load_feed_config(path, CWZ)
    assert (cwz.profile, cwz.update_frequency_s) == ("cwz-1.0", 300)


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"publishr": "x"}, "publishr: unknown key"),
        ({"publisher": None}, "publisher: input should be a valid string, got None"),
        ({"publisher": "  "}, "publisher"),
        ({"road_names": []}, "road_names"),
        ({"direction": "north"}, "direction"),
        ({"start_date": "today"}, "start_date: expected a date like"),
        ({"start_date": 7}, "start_date: expected a date like"),
        ({"start_date": date(2026, 11, 22)}, "start_date: expected a date like"),
        ({"start_date": datetime(2026, 11, 22)}, "start_date: expected a date with its time zone"),
        ({"start_date": datetime(1, 1, 1, tzinfo=timezone(timedelta(hours=5)))},
         "start_date: expected a date like"),
        ({"end_date": "2026-11-22T09:00:00Z"}, "end_date: expected a date after start_date"),
        ({"device_ids": {"a": "1", "b": "1"}}, "device_ids: ids must be unique"),
        ({"contact_email": "nobody"}, "contact_email"),
        ({"verified_below_m": float("nan")}, "verified_below_m"),
        ({"license": "MIT"}, "license"),
        ({"update_frequency_s": -1}, "WZDx 4.2 expects at least 1"),
        ({"project_id": "7"}, "only CWZ 1.0 has it"),
        ({"profile": "cwz-1.0"},
         "CWZ 1.0 requires update_frequency_s, data_source.update_frequency_s, license"),
        (CWZ | {"event_status": "active"}, "CWZ 1.0 has neither event_status nor"),
        ({"data_source": {"organisation": "x"}}, "data_source.organization_name: required"),
    ],
)  # fmt: skip
def test_what_is_refused(changes: dict[str, object], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem) as caught:
        make_feed_config(CONFIG | changes)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("feed settings: ")


@pytest.mark.parametrize(
    "content",
    [
        "",
        "[1]",
        "a: [",
        "road_names: [a]\nroad_names: [b]",
        "a: 2026-13-45",
        "start_date: !!python/object:os.system x",
        "[" * 5000,
    ],
)
def test_files_that_are_no_settings(tmp_path: Path, content: str) -> None:
    path = tmp_path / "feed.yaml"
    path.write_text(content)
    with pytest.raises(ConfigError, match=r"feed\.yaml: ") as caught:
        load_feed_config(path)
    assert "\n" not in str(caught.value)
