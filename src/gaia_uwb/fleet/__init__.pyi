from .failures import (
    FAILURE_FILES as FAILURE_FILES,
    Failure as Failure,
    write_failures as write_failures,
)
from .workers import reconstruct_fleet as reconstruct_fleet
from .zones import ZONES as ZONES, find_zones as find_zones, write_tables as write_tables
