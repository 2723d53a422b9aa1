"""The frequency response of an axis with friction taken out, and the gains that it allows."""

from .of_record import (
    FrequencyResponse,
    ResponsePlan,
    UncertainResponseWarning,
    frequency_response,
    response_plan,
)
from .tuning import Tuning, tune

__all__ = [
    "FrequencyResponse",
    "ResponsePlan",
    "Tuning",
    "UncertainResponseWarning",
    "frequency_response",
    "response_plan",
    "tune",
]
