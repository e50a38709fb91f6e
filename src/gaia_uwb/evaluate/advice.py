"""What a driver or an operator can do for a better result."""

from __future__ import annotations

from enum import StrEnum


class Advice(StrEnum):
    """One thing to do; the order is that in which a report names them."""

    CHECK_LOG = (
        "Check the log first: the unit of the ranges, the ids of the cones, the heights, and "
        "whether both clocks belong to the same drive."
    )
    CHECK_STATEMENT = (
        "Check what was stated about the zone (`--side`, `--closure`, `--spacing`, "
        "`--known-anchor`), and the ids of the cones."
    )
    CHECK_PASSES = (
        "Check that all logs are of this zone and in one frame, and that each cone has the same id "
        "in all of them."
    )
    CHECK_VEHICLE = (
        "Check that the log is of the vehicle that was stated (`--vehicle`, `--clock-offset`); if "
        "it is, calibrate that again (`gaia vehicle calibrate`)."
    )
    CHECK_CONES = (
        "Find out whether these cones were moved between the passes; if so, use only the later "
        "passes."
    )
    SECOND_DRIVE = (
        "Drive past a second time in another lane, or along the other side of the work zone: "
        "ranges from two lines distinguish the sides and locate the cones in both directions."
    )
    OTHER_LANE = (
        "Drive one of the passes in another lane, or along the other side of the work zone: these "
        "ran along nearly one line, which cannot distinguish its two sides."
    )
    WEAVE = (
        "Where a second pass is not possible, change lanes or weave once while passing: a curved "
        "path distinguishes left from right."
    )
    STATE_SIDE = "Note which side of the road these cones are on, and state it (`--side`)."
    SURVEY = (
        "Survey one of these cones and state its position (`--known-anchor`); the map shows both "
        "positions."
    )
    SECOND_TAG = (
        "Mount a second tag on the vehicle, 1 m or more beside the first: two tags distinguish the "
        "sides on any road."
    )
    BOTH_WAYS = (
        "Drive past once in each direction: a clock offset shifts the cones forwards in one "
        "direction and backwards in the other, so it becomes visible."
    )
    ONE_CLOCK = (
        "Better still, timestamp positions and ranges with one clock, such as that of the GNSS "
        "receiver."
    )
    CALIBRATE_VEHICLE = (
        "Calibrate the vehicle once (`gaia vehicle calibrate`) and give what comes of it by "
        "`--vehicle`, or a clock offset that you know by `--clock-offset`."
    )
    LONGER = "Record more of the drive: start well before the first cone and end after the last."
    SLOWER = "Drive past the cones more slowly: half the speed gives twice as many ranges."
    CHECK_RADIOS = "Check these cones' radios: battery, id, and whether they stand upright."
    LINE_OF_SIGHT = (
        "Mount the vehicle's antenna higher, or pass in the lane next to the cones, so that "
        "nothing blocks the line of sight."
    )
    HEIGHTS = "Measure the heights of the antennas to 0.1 m, and add them to the log."
    CALIBRATE = "Calibrate the radios (antenna delay) at a known distance."
    MORE_CONES = "Equip at least three cones that are not on one line."
