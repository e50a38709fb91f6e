from .failures import (
    FAILURE_FILES as FAILURE_FILES,
    Failure as Failure,
    write_failures as write_failures,
)
from .manifests import find_zones as find_zones
from .vehicles import learn_vehicles as learn_vehicles
from .workers import reconstruct_fleet as reconstruct_fleet
from .zones import ZONES as ZONES, write_tables as write_tables
