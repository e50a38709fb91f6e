"""Run cases made after public trouble reports, and judge what ``gaia`` does with each.

Usage: nice python tests/endurance/public_cases.py FOLDER [--case NAME ...] [--table PAGE]

FOLDER holds a folder per case: ``cmd``, lines for a shell, run one by one in a copy of the case's
folder; ``expect``, what is right, in prose; ``truth.json``, where the cones stand. Folders named
``schemas`` and ``cases`` lie side by side, and the commands find the former as ``$SCHEMAS``.

What is right is prose, so every case has a judge here: one or more outcomes (``Outcome``), of which
one must fit. These things are asked of every case besides:

- exit codes are 0, 1 or 2, nothing prints a traceback, an error is one line, no line comes twice;
- a result that is called good is honest: of the cones called ok not all lie outside their own 90 %
  radius, and none outside twice that radius.

The table goes to the page only where all cases were run. Needs the extras ros and feeds.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

SLOWEST_S = 300
QUANTILE_90 = -2.0 * math.log(0.1)
"""Chi-square with two degrees of freedom."""

OWN_IDS = {
    **{"022E": "1", "0C1D": "2", "D0B4": "3", "91AF": "4"},
    **{"21": "1", "22": "2", "23": "3", "24": "4"},
}
"""The radios' own ids in cases whose truth counts the cones."""

READ = r"\bcone +readings"
"""The heading of the table that ``gaia data check`` prints of a log that it read."""


@dataclass(frozen=True)
class Cone:
    """A cone of a result: its place, covariance, and whether it is called ok."""

    place_m: tuple[float, float]
    covariance_m2: tuple[float, float, float]
    is_ok: bool
    side_is_open: bool
    lon_lat: tuple[str, str]

    def error_m(self, truth_m: Sequence[float]) -> float:
        return math.dist(self.place_m, truth_m)

    def error_of_radius(self, truth_m: Sequence[float]) -> float:
        """Return the error as a multiple of the 90 % radius, the ellipse's longer semi-axis."""
        ee, en, nn = self.covariance_m2
        larger_m2 = (ee + nn) / 2 + math.hypot((ee - nn) / 2, en)
        return self.error_m(truth_m) / math.sqrt(QUANTILE_90 * larger_m2)


@dataclass(frozen=True)
class Ran:
    """What the commands of one case printed and wrote."""

    commands: list[tuple[str, int, str, str]]
    """Command line, exit code, stdout, stderr."""
    folder: Path
    truth_m: dict[str, tuple[float, float]]

    @property
    def origin_is_open(self) -> bool:
        """Whether the truth counts from a first fix that the log does not hold."""
        return self.folder.name == "zero-fix-before-lock"

    @property
    def gaia(self) -> list[tuple[str, int, str, str]]:
        return [each for each in self.commands if each[0].startswith("gaia ")]

    @property
    def text(self) -> str:
        """All that a user reads: both streams of every command, and the report."""
        report = self.folder / "out" / "report.md"
        written = report.read_text(encoding="utf-8") if report.is_file() else ""
        printed = "".join(out + err for command, _, out, err in self.gaia)
        return printed + written

    @property
    def exit_of_reconstruct(self) -> int | None:
        codes = [code for command, code, _, _ in self.gaia if " reconstruct " in command]
        return codes[-1] if codes else None

    def cones(self) -> dict[str, Cone]:
        """Return the located cones under the truth's names."""
        for name in ("cones.csv", "anchors.csv"):
            path = self.folder / "out" / name
            if path.is_file():
                with path.open(encoding="utf-8", newline="") as file:
                    rows = [row for row in csv.DictReader(file) if row["east_m"]]
                return {_truth_name(row["anchor_id"]): _cone(row) for row in rows}
        return {}

    def errors(self) -> Iterator[tuple[str, float, float, bool]]:
        """Yield name, error in metres, error in 90 % radii, whether ok, of each known cone."""
        known = {name: cone for name, cone in self.cones().items() if name in self.truth_m}
        moved_m = (0.0, 0.0)
        if self.origin_is_open and known:
            moves = [
                (cone.place_m[0] - self.truth_m[name][0], cone.place_m[1] - self.truth_m[name][1])
                for name, cone in known.items()
            ]
            moved_m = (median(east for east, _ in moves), median(north for _, north in moves))
        for name, cone in known.items():
            truth_m = [a + b for a, b in zip(self.truth_m[name], moved_m, strict=True)]
            yield name, cone.error_m(truth_m), cone.error_of_radius(truth_m), cone.is_ok


def _cone(row: dict[str, str]) -> Cone:
    return Cone(
        place_m=(float(row["east_m"]), float(row["north_m"])),
        covariance_m2=(
            float(row["covariance_ee_m2"]),
            float(row["covariance_en_m2"]),
            float(row["covariance_nn_m2"]),
        ),
        is_ok=row["status"] == "ok",
        side_is_open=row["side_is_open"] == "true",
        lon_lat=(row["lon"], row["lat"]),
    )


def _truth_name(anchor_id: str) -> str:
    bare = anchor_id.removeprefix("'").upper().removeprefix("0X")
    return OWN_IDS.get(bare, bare)


@dataclass(frozen=True)
class Outcome:
    """One way to be right.

    Parameters
    ----------
    exits
        For each ``gaia`` command of the case the exit codes that it may have.
    says, never
        Patterns that something must match in what the user reads, or nothing may.
    within_m
        Every cone of the truth is located, and none is off by more.
    n_cones
        So many cones are located.
    most_lines
        No command prints more lines.
    also
        Anything else; returns what is wrong, or nothing.
    """

    exits: tuple[str, ...] = ()
    says: tuple[str, ...] = ()
    never: tuple[str, ...] = ()
    within_m: float | None = None
    n_cones: int = 0
    most_lines: int | None = None
    also: Callable[[Ran], str] | None = None

    def faults(self, ran: Ran) -> Iterator[str]:
        for (command, code, _, _), allowed in zip(ran.gaia, self.exits, strict=False):
            if str(code) not in allowed:
                yield f"'{command[:60]}' ended with {code}, not {' or '.join(allowed)}"
        text = ran.text
        for pattern in self.says:
            if not re.search(pattern, text, re.IGNORECASE):
                yield f"nothing says /{pattern}/"
        for pattern in self.never:
            if re.search(pattern, text, re.IGNORECASE):
                yield f"something says /{pattern}/"
        yield from self._misplaced(ran)
        if self.most_lines is not None:
            longest = max(len((out + err).splitlines()) for _, _, out, err in ran.gaia)
            if longest > self.most_lines:
                yield f"{longest} lines, not {self.most_lines}"
        if self.also is not None:
            fault = self.also(ran)
            if fault:
                yield fault

    def _misplaced(self, ran: Ran) -> Iterator[str]:
        if self.within_m is not None:
            errors_m = {name: error_m for name, error_m, _, _ in ran.errors()}
            for name in ran.truth_m:
                error_m = errors_m.get(name, math.inf)
                if error_m > self.within_m:
                    yield f"cone {name} is {error_m:.2f} m off, not within {self.within_m} m"
        if len(ran.cones()) < self.n_cones:
            yield f"{len(ran.cones())} cones located, not {self.n_cones}"


def _is_cut(ran: Ran) -> str:
    """Return what is wrong with a boundary across the 180th meridian."""
    features: Any = json.loads((ran.folder / "out" / "boundary.geojson").read_text("utf-8"))
    lines: list[list[list[float]]] = []
    for feature in features["features"]:
        shape = feature["geometry"]["coordinates"]
        for _ in range({"LineString": 0, "Point": -1}.get(feature["geometry"]["type"], 2)):
            if isinstance(shape[0][0], (int, float)):
                break
            if isinstance(shape[0][0][0], (int, float)):
                lines += shape
                break
            shape = [ring for polygon in shape for ring in polygon]
        if feature["geometry"]["type"] == "LineString":
            lines.append(shape)
    if any(abs(a[0] - b[0]) > 180 for line in lines for a, b in pairwise(line)):
        return "boundary.geojson: an edge runs round the globe"
    longitudes = [position[0] for line in lines for position in line]
    if max(longitudes) < 180.0 or min(longitudes) > -180.0:
        return "boundary.geojson: nothing ends at the meridian"
    if "bbox" in features and not features["bbox"][0] > features["bbox"][2]:
        return "boundary.geojson: the box runs round the globe"
    kml = (ran.folder / "out" / "boundary.kml").read_text("utf-8")
    for line in re.findall(r"<coordinates>([^<]*)", kml):
        east = [float(position.split(",")[0]) for position in line.split()]
        if any(abs(a - b) > 180 for a, b in pairwise(east)):
            return "boundary.kml: an edge runs round the globe"
    return ""


def _is_southwest(ran: Ran) -> str:
    signs = {value.startswith("-") for cone in ran.cones().values() for value in cone.lon_lat}
    return "" if signs == {True} else "longitudes and latitudes are not all below 0"


def _is_open(ran: Ran) -> str:
    return "" if all(cone.side_is_open for cone in ran.cones().values()) else "a side is decided"


def _is_inside(ran: Ran) -> str:
    worst = max((multiple for *_, multiple, _ in ran.errors()), default=math.inf)
    return "" if worst <= 1.2 else f"a cone is {worst:.1f} times its 90 % radius off"


@dataclass(frozen=True)
class Case:
    """A case, its family, what is right in a few words, and the outcomes that are right."""

    name: str
    family: str
    right: str
    outcomes: tuple[Outcome, ...]


def _case(name: str, family: str, right: str, *outcomes: Outcome) -> Case:
    return Case(name, family, right, outcomes)


CM = Outcome(("0", "0"), within_m=0.6)  # twice the 90 % radius of these logs
LOG, ROS, TEXT, DRIVE = "ranges", "ROS logs", "serial logs", "trajectories"
GEOMETRY, FEED, FORM = "sites and radios", "feeds: content", "feeds: form"
READ_APART = Outcome(("2",), (r"times do not overlap.* the trajectory 17725\d\d\d\d\d",))
"""The trajectory was read, with its date; the case's single range has a time of its own."""
REFUSED, INVALID, VALID = ("2",), ("2", "2"), ("0", "0")

CASES = (
    _case("altitude-in-cm", DRIVE, "heights in doubt", Outcome(("12", "12"), ("height",)),
          Outcome(("012", "12"), ("height",))),
    _case("anchors-on-the-path", GEOMETRY, "in doubt", Outcome(("012", "12"))),
    _case("antenna-delay-one-anchor", GEOMETRY, "the cone named, or inside its radius",
          Outcome(("012", "01"), also=_is_inside),
          Outcome(("012", "1"), (r"\b2\b.*(fit|long|bias|differ)",))),
    _case("antenna-delay-unset", GEOMETRY, "in doubt, bias or units named",
          Outcome(("012", "12"), ("bias|too long|antenna|units",))),
    _case("antimeridian", GEOMETRY, "shapes cut at 180 degrees, feed or one line",
          Outcome(("0", "0", "02", "02"), within_m=0.3, also=_is_cut)),
    _case("centimetres-small-site", LOG, "in doubt, units named",
          Outcome(("12", "12"), ("units|centimetres|too long|far",))),
    _case("clock-drift-1-percent", LOG, "honest, or in doubt",
          Outcome(("012", "0"), also=_is_inside), Outcome(("012", "1"))),
    _case("clock-steps-back", LOG, "the step named with row and size",
          Outcome(("12", "12"), (r"(?=.*\brow \d+)(?=.*(back|step|earlier))(?=.*\b5(\.\d+)? s)",))),
    _case("db3-wal-left", ROS, "all messages read, or the -wal file named",
          Outcome(("01", "01"), n_cones=4), Outcome(("012", "012"), ("-wal",))),
    _case("dwm1001-broken-lines", TEXT, "broken lines counted",
          Outcome(("0", "0"), (r"\d+ broken lines",), within_m=0.6)),
    _case("dwm1001-nan-est", TEXT, "read", CM),
    _case("dwm3001-cli", TEXT, "read, or the kind named", Outcome(("01",), (READ,)),
          Outcome(REFUSED, ("DWM3001|SESSION_INFO",), ("are broken",))),
    _case("empty-range-cells", LOG, "left out and counted, or refused",
          Outcome(("0", "0"), (r"\d+ (rows|cells|readings|values)|empty",), within_m=0.6),
          Outcome(("2", "2"), ("empty cell",))),
    _case("from-id-to-id", ROS, "asks, or says which field it took",
          Outcome(("012", "012"), ("from_id|to_id",))),
    _case("gpx-track", DRIVE, "read, or formats listed", Outcome(("01",), (READ,)), READ_APART,
          Outcome(REFUSED, ("nmea", "csv"), ("input tag",))),
    _case("header-zero-at-start", ROS, "left out and counted, or the way out named",
          Outcome(("2", "2"), ("clock: receive",)), Outcome(("01", "01"), ("header|stamp",))),
    _case("hex-case-ids", LOG, "the mismatch of ids named",
          Outcome(("012", "012"), (r"lacks .*022e|not match|same id|differ in|spell",)),),
    _case("host-local-time", TEXT, "the hour named",
          Outcome(("12",), ("not overlap|not meet", r"utc_offset_h|\bhour"))),
    _case("humble-range-no-definition", ROS, "read, or msg_dir named", Outcome(("01",), (READ,)),
          Outcome(REFUSED, ("msg_dir",))),
    _case("int-mm-camelcase", ROS, "not taken for metres; read as described",
          Outcome(("2", "0"), ("gaia.yaml",), within_m=0.6),
          Outcome(("01", "0"), (r"\bmm\b|millimet|0\.001",), within_m=0.6)),
    _case("jump-and-slow-decay", LOG, "decimetres, or honest", Outcome(("012", "01"), within_m=0.5),
          Outcome(("012", "1"))),
    _case("latlon-swapped-us", DRIVE, "the swap named", Outcome(("2", "2"), ("swapped",))),
    _case("linktrack-tagframe0", ROS, "read, or arrays without ids named",
          Outcome(("01", "012"), (READ,)), Outcome(("012", "01"), (READ,)),
          Outcome(("2", "2"), ("without ids|no ids|index",))),
    _case("mcap-cut-off", ROS, "read, with a note", Outcome(("0", "0"), ("cut off",), n_cones=4)),
    _case("ned-trajectory", DRIVE, "read, or told what to do with down",
          Outcome(("01",), (READ,)), Outcome(REFUSED, ("down",), ("constrained",))),
    _case("nmea-date-before-fix", TEXT, "the date of a valid RMC counts", CM),
    _case("nmea-deg-instead-of-degmin", TEXT, "in doubt", Outcome(("012", "12"))),
    _case("nmea-gn-and-gp", TEXT, "the better fix of a moment counts, or the mixture is told", CM,
          Outcome(("012", "12"), ("quality|qualities|GPGGA",))),
    _case("nmea-midnight", TEXT, "places", CM),
    _case("nmea-no-geoid-field", TEXT, "places, heights missing",
          Outcome(("0", "0"), ("height",), within_m=0.6)),
    _case("nmea-rmc-only", TEXT, "read, or RMC named", Outcome(("01",), (READ,)),
          Outcome(REFUSED, ("RMC",))),
    _case("nmea-southwest", TEXT, "places south and west",
          Outcome(("0", "0"), within_m=0.6, also=_is_southwest)),
    _case("reused-anchor-id", LOG, "in doubt, the anchor named",
          Outcome(("12", "12"), (r"\b2\b.*(two places|fit|usable|discard|disagree|spike|apart)",))),
    _case("ros1-bz2", ROS, "read", CM),
    _case("ros1-unindexed", ROS, "read with a note; .active: rename it, or read",
          Outcome(("2", "0", "0"), (r"renam|a \.bag", "cut off|index"), within_m=0.6),
          Outcome(("01", "0", "0"), ("cut off|index",), within_m=0.6)),
    _case("rtklib-pos", DRIVE, "read, or told how to convert", Outcome(("01",), (READ,)),
          Outcome(REFUSED, ("RTKLIB|convert|separat",))),
    _case("sentinel-65535-mm", LOG, "left out and named; places",
          Outcome(("01", "0"), (r"65\.535|65535",), within_m=0.6)),
    _case("slash-dates", DRIVE, "read, or the form named", Outcome(("01",), (READ,)), READ_APART,
          Outcome(REFUSED, ("ISO",))),
    _case("straight-path-one-side", GEOMETRY, "all sides open",
          Outcome(("01", "1"), also=_is_open)),
    _case("tf-only", ROS, "read, or told that tf is not read", Outcome(("012", "01"), (READ,)),
          Outcome(("01", "012"), (READ,)),
          Outcome(("2", "2"), (r"/tf.*(not read|TransformStamped|frame)",))),
    _case("trek1000-mc", TEXT, "read, or kinds listed", Outcome(("01",), (READ,)),
          Outcome(REFUSED, ("lec", "les"))),
    _case("ts-moreutils-stamps", TEXT, "read, or the stamps named", Outcome(("01",), (READ,)),
          Outcome(REFUSED, ("stamp",), ("are broken",))),
    _case("tum-trajectory", DRIVE, "read, or the blanks named", Outcome(("01",), (READ,)),
          Outcome(REFUSED, (r"blank|space|separat|\btum\b",))),
    _case("two-tags-column", LOG, "refused or in doubt, the column named",
          Outcome(("12", "12"), ("tag_id",))),
    _case("whole-second-stamps", LOG, "the lost readings counted",
          Outcome(("01", "01"), (r"\b290\b|whole second",))),
    _case("zero-fix-before-lock", DRIVE, "the rows at 0,0 named or left out",
          Outcome(("2", "2"), (r"\brows? 2\b",), (r"row 7,",)),
          Outcome(("01", "0"), (r"\b5 (rows|positions|fixes|samples)|rows? 2\b",), within_m=0.6)),
    _case("zero-when-out-of-range", LOG, "left out and counted; places",
          Outcome(("01", "0"), ("no range|left out|skipped|placeholder",), within_m=0.6)),
    _case("wzdx-4-numbers", FEED, "invalid, named", Outcome(INVALID, (r"coordinates\[0\]",))),
    _case("wzdx-40-feed", FORM, "the version named",
          Outcome(("02", "02"), (r"'4\.0'|\b4\.0\b",), most_lines=4)),
    _case("wzdx-41-feed", FORM, "4.1 and 4.2 named, no flood",
          Outcome(("02", "02"), (r"4\.1", r"4\.2"), most_lines=3)),
    _case("wzdx-bbox-latlon", FEED, "invalid, named once",
          Outcome(INVALID, (r"\$\.bbox",), (r"coordinates\[",))),
    _case("wzdx-date-7-digits", FEED, "valid", Outcome(VALID)),
    _case("wzdx-date-9999", FEED, "valid", Outcome(VALID)),
    _case("wzdx-dates-naive", FEED, "invalid, both named",
          Outcome(INVALID, ("start_date: expected", "end_date: expected"))),
    _case("wzdx-direction-misplaced", FEED, "invalid, named", Outcome(INVALID, ("direction",))),
    _case("wzdx-empty-features", FEED, "valid", Outcome(VALID)),
    _case("wzdx-html-error", FORM, "refused in one line that says HTML",
          Outcome(INVALID, (r"\bHTML",))),
    _case("wzdx-int-id", FEED, "invalid, named", Outcome(INVALID, (r"\.id: expected",))),
    _case("wzdx-lanes-contradict", FEED, "a warning",
          Outcome(("02", "02"), (r"lanes.*warning",))),
    _case("wzdx-list-of-features", FORM, "invalid, the wrapping named",
          Outcome(INVALID, (r"\$\.data|'data'",))),
    _case("wzdx-multipoint", FEED, "valid", Outcome(VALID, never=("warning",))),
    _case("wzdx-multipoint-one", FEED, "a warning", Outcome(VALID, ("warning",))),
    _case("wzdx-null-optional", FEED, "invalid, both named",
          Outcome(INVALID, ("description: expected", "related_road_events: expected"))),
    _case("wzdx-optional-wrong-type", FEED, "invalid; without schemas, told what is not checked",
          Outcome(INVALID, ("are_workers_present", "reduced_speed_limit_kph", "--schemas"))),
    _case("wzdx-restriction-event", FORM, "invalid, a feed of its own",
          Outcome(INVALID, ("restriction.*feed",))),
    _case("wzdx-swapped-iowa", FEED, "invalid, the swap named",
          Outcome(INVALID, ("longitude comes first",))),
    _case("wzdx-swapped-miami", FEED, "the swap named",
          Outcome(("02", "02"), ("longitude comes first",))),
    _case("wzdx-version-number", FEED, "invalid, named", Outcome(INVALID, ("version: expected",))),
    _case("wzdx-web-mercator", FORM, "invalid, the crs or metres named",
          Outcome(INVALID, ("crs|metres|EPSG",), most_lines=10)),
)  # fmt: skip


def run_case(folder: Path, schemas: Path, work: Path) -> Ran:
    """Run a case's commands in a copy of its folder."""
    shutil.rmtree(work, ignore_errors=True)
    shutil.copytree(folder, work)
    for path in (work, *work.rglob("*")):
        path.chmod(path.stat().st_mode | 0o200)
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "SCHEMAS": str(schemas),
        "COLUMNS": "1000",
    }
    commands = []
    for line in (folder / "cmd").read_text(encoding="utf-8").splitlines():
        if line.strip():
            done = subprocess.run(
                ["bash", "-c", line],
                cwd=work, env=environment, stdin=subprocess.DEVNULL, capture_output=True,
                timeout=SLOWEST_S, check=False,
            )  # fmt: skip
            out, err = (s.decode("utf-8", "backslashreplace") for s in (done.stdout, done.stderr))
            commands.append((line, done.returncode, out, err))
    truth = folder / "truth.json"
    truth_m = json.loads(truth.read_text(encoding="utf-8")) if truth.is_file() else {}
    return Ran(commands, work, truth_m)


def common_faults(ran: Ran) -> Iterator[str]:
    """Yield what is wrong with a case, whatever the case."""
    for command, code, out, err in ran.gaia:
        if code not in (0, 1, 2):
            yield f"'{command[:60]}' ended with {code}"
        if "Traceback" in out + err:
            yield f"'{command[:60]}' printed a traceback"
        failures = [line for line in err.splitlines() if line.startswith("gaia: ")]
        if len(failures) > 1:
            yield f"'{command[:60]}' printed {len(failures)} errors"
        if " validate " in command:
            lines = out.splitlines()
            if len(set(lines)) < len(lines):
                yield f"'{command[:60]}' printed a line twice"
    if ran.exit_of_reconstruct == 0:
        multiples = {name: multiple for name, _, multiple, is_ok in ran.errors() if is_ok}
        outside = [name for name, multiple in multiples.items() if multiple > 1.0]
        far = [
            f"cone {name} is {m:.1f} times its radius off"
            for name, m in multiples.items()
            if m > 2.0
        ]
        yield from far
        if outside and len(outside) == len(multiples) and not far:
            yield f"cones {', '.join(outside)} are outside their 90 % radius, all called ok"


def faults(case: Case, ran: Ran) -> list[str]:
    """Return what is wrong with what gaia does with a case; of several outcomes, the nearest."""
    found = [list(outcome.faults(ran)) for outcome in case.outcomes]
    return [*common_faults(ran), *min(found, key=len)]


def what_it_did(ran: Ran) -> str:
    """Say in a few words what came of a case."""
    codes = [code for _, code, _, _ in ran.gaia]
    if ran.exit_of_reconstruct in (0, 1):
        words = "ok" if ran.exit_of_reconstruct == 0 else "in doubt"
        errors_m = [error_m for _, error_m, _, _ in ran.errors()]
        return f"{words}, at most {max(errors_m):.2f} m off" if errors_m else words
    if all(" validate " in command for command, *_ in ran.gaia):
        warned = ", with a warning" if "warning" in ran.text else ""
        return "invalid" if 2 in codes else f"valid{warned}"
    if 2 in codes:
        return "read, but times apart" if "times do not overlap" in ran.text else "refused"
    return "read" if codes == [0] else "read, a problem named"


PAGE = """# Logs and feeds that people had trouble with

Public trouble reports tell what logs and feeds do to a program: two tags in one file, a clock that
is set back, a recording without an end. {n} such situations, each rebuilt as a small input, are run
by `python tests/endurance/public_cases.py FOLDER` and judged one by one. Whatever the case, each
must end in one of the documented exit codes and without a traceback, and a result that is called
good must be as good as it says.

*ok*: a reliable result; *in doubt*: a result that is marked unreliable, with the reason; *read*: by
`gaia data check`; *refused*: one line that says what is wrong, and where there is one, the way out.
The distance is that of the cone which is farthest from its true place.

| family | cases | right | what GAIA does now |
|---|---:|---:|---|"""


def page(rows: Sequence[tuple[Case, str, bool]]) -> str:
    """Return the documentation's page: a table of the families and one of all cases."""
    families = dict.fromkeys(case.family for case, _, _ in rows)
    lines = [PAGE.format(n=len(rows))]
    for family in families:
        of_it = [(what, right) for case, what, right in rows if case.family == family]
        counted: dict[str, int] = {}
        for what, _ in of_it:
            kind = what.split(", at most")[0]
            counted[kind] = counted.get(kind, 0) + 1
        did = "; ".join(f"{n} {kind}" for kind, n in sorted(counted.items(), key=lambda x: -x[1]))
        lines.append(f"| {family} | {len(of_it)} | {sum(right for _, right in of_it)} | {did} |")
    right = sum(right for _, _, right in rows)
    lines += [
        f"| **all** | **{len(rows)}** | **{right}** | |",
        "",
        "| case | what is right | what GAIA does now | right |",
        "|---|---|---|---|",
        *(
            f"| {case.name} | {case.right} | {what} | {'yes' if right else 'no'} |"
            for case, what, right in rows
        ),
        "",
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--case", action="append", default=[], choices=[c.name for c in CASES])
    parser.add_argument("--table", type=Path, metavar="PAGE", help="write the page there")
    arguments = parser.parse_args()
    there = {path.name for path in arguments.folder.iterdir() if (path / "cmd").is_file()}
    unknown = sorted(there - {case.name for case in CASES})
    if unknown:
        print(f"not judged: {', '.join(unknown)}")
    chosen = [case for case in CASES if case.name in (arguments.case or there)]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for case in chosen:
            schemas = arguments.folder.resolve().parent / "schemas"
            ran = run_case(arguments.folder / case.name, schemas, Path(folder) / case.name)
            wrong = faults(case, ran)
            rows.append((case, what_it_did(ran), not wrong))
            verdict = "right" if not wrong else f"WRONG: {'; '.join(wrong)}"
            print(f"{case.name:28} {rows[-1][1]:32} {verdict}", flush=True)
    print(f"{sum(right for _, _, right in rows)} of {len(rows)} right")
    if arguments.table is not None and len(rows) == len(CASES):
        arguments.table.write_text(page(rows), encoding="utf-8")
    if not all(right for _, _, right in rows):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
