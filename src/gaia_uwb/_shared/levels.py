"""The one level of confidence that people see: 90 %."""

from __future__ import annotations

import math

CHI_SQUARE_90 = 2.0 * math.log(10.0)
"""Squared distance, in standard deviations, that 90 % of normal points of a plane keep within."""

SIGMAS_90 = 1.645
"""A normally distributed number is within so many standard deviations with 90 % probability."""
