"""A fleet knows its vehicles, or learns them over its zones."""

from __future__ import annotations

from pathlib import Path

import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.config import Known, PipelineConfig
from gaia_uwb.fleet.manifests import find_zones
from gaia_uwb.fleet.vehicles import learn_vehicles
from gaia_uwb.fleet.zones import reconstruct_zone
from gaia_uwb.logs import Vehicle, read_vehicle, write_native, write_vehicle
from gaia_uwb.simulate import PRESETS, simulate_zone

RAW = PipelineConfig(denoiser="raw")
TOLD = {"clock_offset_s": [0.12, 0.01], "range_bias_m": [0.2, 0.03]}
OPEN = {"clock_offset_s": [0.0, 0.5]}


@pytest.fixture(scope="module")
def manifest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two zones: one that two vehicles pass, and one that one of them passes again."""
    folder = tmp_path_factory.mktemp("fleet")
    rows = ["log,zone,vehicle"]
    for zone in range(2):
        for number, scene in enumerate(simulate_zone(PRESETS["lane-closure"], 3, zone=zone)):
            if zone == 0 or number == 0:
                name = f"zone-{zone}-{number}"
                write_native(scene, folder / name, file_format="parquet")
                rows.append(f"{name},zone-{zone},{('van-7', 'truck')[number]}")
    path = folder / "fleet.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def test_a_manifest_says_who_drove(manifest: Path) -> None:
    one, two = find_zones(manifest)
    assert one.vehicles == (Vehicle(name="van-7"), Vehicle(name="truck"))
    assert two.vehicles == (Vehicle(name="van-7"),)
    van = Vehicle(name="van-7", range_bias_m=Known(value=0.1, sigma=0.1))
    assert find_zones(manifest, vehicles=[van])[0].vehicles == (van, Vehicle(name="truck"))


def test_a_single_vehicle_drove_all_logs_that_name_none(tmp_path: Path) -> None:
    path = tmp_path / "fleet.csv"
    path.write_text("log,zone\na,north\nb,south\n", encoding="utf-8")
    van, truck = Vehicle(name="van-7"), Vehicle(name="truck")
    assert [zone.vehicles for zone in find_zones(path)] == [(), ()]
    assert [zone.vehicles for zone in find_zones(path, vehicles=[van])] == [(van,), (van,)]
    with pytest.raises(InputError) as caught:
        find_zones(path, vehicles=[van, truck])
    assert str(caught.value) == (
        f"{path}: --vehicle gives 2 vehicles, but no log names its own: add a column vehicle to a "
        "CSV manifest"
    )


def test_a_name_that_cannot_be_a_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "fleet.csv"
    path.write_text("log,zone,vehicle\na,north,a/b\n", encoding="utf-8")
    with pytest.raises(InputError, match="vehicle 'a/b': the name cannot be that of a file"):
        find_zones(path)


def test_drives_of_all_zones_teach_a_vehicle(tmp_path: Path) -> None:
    (van,) = learn_vehicles([{"van-7": TOLD}, {"van-7": TOLD}, {}], tmp_path)
    assert (van.name, van.n_zones, van.unknown) == ("van-7", 2, ())
    assert van.path == tmp_path / "vehicles" / "van-7.yaml"
    clock = read_vehicle(van.path).clock_offset_s
    assert clock is not None
    assert clock.value == pytest.approx(0.12, abs=1e-3)
    assert clock.sigma == pytest.approx(0.01 / 2**0.5, abs=1e-4)


def test_what_drives_no_longer_tell_is_not_kept(tmp_path: Path) -> None:
    learn_vehicles([{"van-7": TOLD}], tmp_path)
    (van,) = learn_vehicles([{"van-7": OPEN}], tmp_path)
    assert van.path is None
    assert not (tmp_path / "vehicles" / "van-7.yaml").exists()


def test_a_zone_keeps_what_it_says_of_unknown_vehicles(manifest: Path, tmp_path: Path) -> None:
    zone = find_zones(manifest)[1]
    first = reconstruct_zone(zone, tmp_path, RAW)
    assert first.vehicles["van-7"]["clock_offset_s"][0] == pytest.approx(0.2, abs=0.03)
    assert reconstruct_zone(zone, tmp_path, RAW) == first  # read back, not done again


def test_the_command_learns_a_vehicle_and_knows_it_the_next_time(
    run, manifest: Path, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    config = tmp_path / "raw.yaml"
    config.write_text("denoiser: raw\n", encoding="utf-8")
    options = ("--config", config, "--out", tmp_path / "one")
    _, out, err = run("fleet", manifest, *options)
    learned = tmp_path / "one" / "vehicles"
    assert err == ""
    assert f"vehicle van-7, past 2 zones: learned, in {learned / 'van-7.yaml'}\n" in out
    assert f"vehicle truck, past 1 zone: learned, in {learned / 'truck.yaml'}\n" in out
    options = ("--config", config, "--vehicle", learned, "--out", tmp_path / "two")
    _, out, _ = run("fleet", manifest, *options)
    assert "vehicle van-7" not in out
    settings = (tmp_path / "two" / "zone-0" / "config.yaml").read_text(encoding="utf-8")
    assert "van-7" in settings and "truck" in settings


def test_two_files_of_one_name_are_refused(run, manifest: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    for name in ("a", "b"):
        write_vehicle(Vehicle(name="van-7"), tmp_path / f"{name}.yaml")
    files = ("--vehicle", tmp_path / "a.yaml", "--vehicle", tmp_path / "b.yaml")
    code, _, err = run("fleet", manifest, *files, "--out", tmp_path / "out")
    a, b = tmp_path / "a.yaml", tmp_path / "b.yaml"
    assert (code, err) == (2, f"gaia: --vehicle: {a} and {b} have the same name, van-7\n")
