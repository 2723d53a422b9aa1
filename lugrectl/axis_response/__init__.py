"""The frequency response of an axis from an ordinary log, with friction taken out."""

from .of_record import frequency_response
from .result import FrequencyResponse

__all__ = ["FrequencyResponse", "frequency_response"]
