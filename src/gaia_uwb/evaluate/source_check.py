"""Check everything that a source names."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from gaia_uwb._shared import InputError
from gaia_uwb.api import SIMULATOR, load_scenes, logs_of, read_log
from gaia_uwb.config import PipelineConfig
from gaia_uwb.evaluate.log_check import CheckReport, check_scene
from gaia_uwb.logs import REGISTRY, Vehicle, dataset_folder, import_function


def check_source(
    source: str,
    config: PipelineConfig = PipelineConfig(),
    *,
    data_dir: Path | None = None,
    vehicle: Vehicle | None = None,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> list[CheckReport]:
    """Check everything that a source names; an unreadable scene gets a report that says so.

    Parameters
    ----------
    source, data_dir, vehicle
        Like :func:`load_scenes`.
    config
        What is known of vehicles counts, and how logs are prepared.
    progress
        Called with what is checked, and how much of it is done and there is: logs, and cones of a
        log.

    Returns
    -------
    list of CheckReport
        One per scene; for a whole data set, one more about what its scenes do not show.

    Raises
    ------
    SourceError
        If there is no such folder, name or part, or the data set has not been fetched.
    """
    name, _, part = source.partition(":")
    if name == SIMULATOR or name in REGISTRY:
        try:
            scenes = load_scenes(source, data_dir=data_dir, vehicle=vehicle)
            reports = [check_scene(scene, config) for scene in scenes]
            checker = REGISTRY[name].checker if name in REGISTRY and not part else None
            if checker is not None:
                reports.append(import_function(checker)(dataset_folder(name, data_dir)))
        except InputError as error:
            reports = [CheckReport.of_failure(source, error)]
        return reports
    logs = logs_of(source)
    reports = []
    for done, path in enumerate(logs):
        progress("check", done, len(logs))
        try:
            scene = read_log(path, vehicle=vehicle)
            told = partial(progress, f"check {path.name}")
            reports.append(check_scene(scene, config, progress=told))
        except Exception as error:  # a fault in one log must not cost the others
            reports.append(CheckReport.of_failure(str(path), error))
    return reports
