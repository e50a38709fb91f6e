from .workers import reconstruct_fleet as reconstruct_fleet
from .zones import TABLES as TABLES, find_zones as find_zones, write_tables as write_tables
