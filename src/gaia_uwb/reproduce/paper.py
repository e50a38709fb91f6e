"""The numbers that the paper prints, to stand beside ours."""

from __future__ import annotations

from types import MappingProxyType

METRICS = MappingProxyType(
    {
        "distance_mse_overall": "MSE (m²)",
        "distance_mse_los": "MSE LOS (m²)",
        "distance_mse_nlos": "MSE NLOS (m²)",
        "anchor_mae": "anchor error (m)",
        "polygon_iou": "IoU",
        "polygon_hausdorff": "Hausdorff (m)",
    }
)
"""The paper's six metrics in its order, as columns of tables are called."""

NAMES = MappingProxyType(
    {
        "kalman": "Kalman",
        "mlp": "MLP",
        "pose-kalman": "PoseKalman",
        "pose-mlp": "PoseMLP",
        "gaia": "GAIA",
        "without-layout-head": "w/o Layout Head",
        "without-geo-dist": "w/o GeoDist",
        "unfrozen-base": "Unfreeze PoseMLP Base",
    }
)
"""What the paper calls our methods."""

TABLE_1 = MappingProxyType(
    {
        "kalman": (0.1939, 0.2385, 0.1777, 3.3650, 0.0846, 4.6569),
        "mlp": (0.5812, 1.0111, 0.4248, 2.8809, 0.0457, 3.3946),
        "pose-kalman": (0.4733, 0.1902, 0.5762, 12.9340, 0.0159, 15.8975),
        "pose-mlp": (0.1733, 0.1102, 0.1962, 2.1703, 0.2069, 3.2905),
        "gaia": (0.1414, 0.1098, 0.1529, 2.2493, 0.2390, 3.7241),
    }
)
"""Real data, 15 windows of 64 steps."""

TABLE_2 = MappingProxyType(
    {
        "kalman": (3.9913, 1.4998, 4.6750, 32.3894, 0.2404, 62.5128),
        "mlp": (1.6514, 1.2088, 1.7728, 30.7023, 0.2668, 54.4222),
        "pose-kalman": (1.7323, 0.4998, 2.0706, 32.5667, 0.2519, 56.9666),
        "pose-mlp": (0.7773, 0.6494, 0.8124, 25.6580, 0.3531, 37.8489),
        "gaia": (0.3821, 0.3567, 0.3890, 19.7536, 0.4286, 30.9233),
    }
)
"""The stress test, 216 episodes."""

ABLATION = MappingProxyType(
    {
        "without-layout-head": (0.6520, 0.5817, 0.6713, 26.1689, 0.3475, 39.6997),
        "without-geo-dist": (0.5520, 0.4866, 0.5699, 24.9683, 0.3654, 36.1815),
        "unfrozen-base": (0.7720, 0.8036, 0.7633, 23.1187, 0.3799, 36.3602),
        "gaia": (0.3821, 0.3567, 0.3890, 19.7536, 0.4286, 30.9233),
    }
)
"""Table 3."""

TABLE_4 = MappingProxyType(
    {
        "range-noise": (0.429, 0.376, 0.058),
        "outliers": (0.429, 0.364, 0.044),
        "nlos-bias": (0.429, 0.192, 0.050),
        "anchors": (0.429, 0.181, 0.006),
    }
)
"""GAIA's IoU without stress, at the most severe setting, and its margin there."""
