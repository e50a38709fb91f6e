from .described import (
    is_described as is_described,
    named_elsewhere as named_elsewhere,
    read_described as read_described,
)
from .download import data_folder as data_folder, dataset_folder as dataset_folder, fetch as fetch
from .episodes import (
    count_episodes as count_episodes,
    read_episodes as read_episodes,
    write_episodes as write_episodes,
)
from .input_description import InputDescription as InputDescription
from .native import (
    is_native as is_native,
    read_native as read_native,
    write_native as write_native,
)
from .outdoor_static import StaticFile as StaticFile, load_static as load_static
from .places_for_results import log_files as log_files, results_folder as results_folder
from .registry import REGISTRY as REGISTRY, Dataset as Dataset, import_function as import_function
from .vehicle import (
    Vehicle as Vehicle,
    VehicleTag as VehicleTag,
    read_vehicle as read_vehicle,
    vehicle_text as vehicle_text,
    write_vehicle as write_vehicle,
)
