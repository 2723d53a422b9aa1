"""The classes of all results, for type hints and ``isinstance``: ``lg.results.SprVerdict``."""

from .bench.assure import Assurance, HuntingChance
from .bench.compensate import Compensation, Run
from .bench.observers import Candidate as RankedObserver
from .bench.observers import Compared, ObserverComparison, Recommendation
from .commissioning.of_record import FrequencyResponse, ResponsePlan
from .commissioning.tuning import Tuning
from .design import Certificate, Design, Excitation, ObserverDesign
from .diagnosis.compare_laws import ComparedLaw, LawComparison
from .diagnosis.diagnose import Identification
from .diagnosis.fleet import Fleet, Outcome
from .diagnosis.result import Diagnosis
from .estimates.findings import (
    Balance,
    Candidate,
    Comparison,
    Estimate,
    Finding,
    FrictionMap,
    Joint,
    Residuals,
    Table,
    Traces,
)
from .estimates.fitted import Members, Parameter, ParameterTable
from .hunting.hunt import LimitCycles
from .hunting.loop import HuntingMap
from .hunting.stick_slip import StickSlip
from .linear.band import BandwidthVerdict
from .linear.designs import DesignChecks
from .linear.l2 import L2Verdict
from .linear.passivity import PassivityVerdict
from .linear.spr import Repair, SprVerdict
from .linear.stability import StabilityVerdict
from .paper.runs import Reproduction
from .simulation.sweep import Sweep

__all__ = [
    "Assurance", "Balance", "BandwidthVerdict", "Candidate", "Certificate", "Compared",
    "ComparedLaw", "Comparison", "Compensation", "Design", "DesignChecks", "Diagnosis", "Estimate",
    "Excitation", "Finding", "Fleet", "FrequencyResponse", "FrictionMap", "HuntingChance",
    "HuntingMap", "Identification", "Joint", "L2Verdict", "LawComparison", "LimitCycles", "Members",
    "ObserverComparison", "ObserverDesign", "Outcome", "Parameter", "ParameterTable",
    "PassivityVerdict", "RankedObserver", "Recommendation", "Repair", "Reproduction", "Residuals",
    "ResponsePlan", "Run", "SprVerdict", "StabilityVerdict", "StickSlip", "Sweep", "Table",
    "Traces", "Tuning",
]  # fmt: skip
