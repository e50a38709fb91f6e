from .advice import Advice as Advice
from .bootstrap import paired_difference as paired_difference
from .bounds import cramer_rao_m as cramer_rao_m, wrong_sides_probability as wrong_sides_probability
from .limits import (
    Limit as Limit,
    find_limits as find_limits,
    limits_of_reasons as limits_of_reasons,
)
from .log_check import CheckReport as CheckReport, check_scene as check_scene
from .metrics import Metric as Metric, aggregate as aggregate, score_episode as score_episode
from .residuals import range_residual_m as range_residual_m
from .rigid_alignment import (
    RigidAlignment as RigidAlignment,
    rigid_align as rigid_align,
    rotation_matrix as rotation_matrix,
)
from .road_scores import score_road as score_road
from .scores import (
    TestSet as TestSet,
    episodes_csv as episodes_csv,
    make_test as make_test,
    reconstruct_and_score as reconstruct_and_score,
    results_json as results_json,
    score_method as score_method,
)
from .source_check import check_source as check_source
from .stressors import STRESSORS as STRESSORS, Stressor as Stressor, stress as stress
from .what_if import Improvement as Improvement, improvements as improvements
