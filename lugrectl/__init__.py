"""Friction in servo drives: blocks for python-control, observers, checks, and diagnosis of logs.

Names are loaded on first use, so that the command line starts quickly.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOMES = {
    "spec": "block P",
    "blocks.bristle_observers": "friction_state_observer lyapunov_observer normal_force_observer "
    "temperature_observer",
    "blocks.comparison": "adaptive_observer disturbance_observer extended_state_observer "
    "friedland_park_observer general_coulomb_observer",
    "blocks.controllers": "compensation error feedforward pi pid prefilter",
    "blocks.delayed": "coulomb_compensation coulomb_predictor smith_velocity",
    "blocks.learning": "repetitive_control repetitive_memory",
    "blocks.drive": "current_lag dead_time limiter notch proportional",
    "blocks.library": "effect friction",
    "blocks.observers": "existing_observer natural_observer proposed_observer",
    "blocks.plant": "plant sensor",
    "blocks.position_observers": "position_coulomb_observer position_lugre_observer",
    "blocks.sliding": "adaptive_slotine_li backstepping_smc dual_observer_control slotine_li "
    "sliding_error",
    "blocks.table": "tabulated",
    "bristles": "deflection",
    "cascade": "cascade_loop",
    "catalogue": "controllers effects laws observers",
    "comparing": "ObserverComparison Recommendation compare_observers recommend_observer",
    "compensating": "Compensation compensate",
    "design": "Certificate Design ObserverDesign PAPER certify design_gains excitation "
    "natural_decay",
    "diagnosis.asking": "balance",
    "diagnosis.diagnose": "diagnose",
    "engine.adaptive": "Diverged",
    "ensemble": "Sweep sweep sweep_chunks",
    "errors": "InputError Refused",
    "fleet": "Fleet diagnose_each",
    "diagnosis.identify": "identify",
    "diagnosis.laws": "LawComparison compare_laws",
    "linear": "bandwidth bandwidth_check check_designs l2_check position_T position_loop_tf "
    "spr_check spr_repair velocity_T velocity_loop_tf",
    "loops": "position_loop velocity_loop",
    "mixed": "simulate_sampled",
    "model": "Model Parameters table1",
    "model_file": "read_model write_model",
    "record": "Record read_record",
    "results": "Diagnosis Table",
    "sampling": "sampled",
    "simulation": "simulate",
}
_HOME = {name: home for home, names in _HOMES.items() for name in names.split()}

__all__ = sorted([*_HOME, "__version__"])  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'lugrectl' has no attribute '{name}'")
    value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__


if TYPE_CHECKING:
    from .blocks.bristle_observers import (  # noqa: F401
        friction_state_observer,
        lyapunov_observer,
        normal_force_observer,
        temperature_observer,
    )
    from .blocks.comparison import (  # noqa: F401
        adaptive_observer,
        disturbance_observer,
        extended_state_observer,
        friedland_park_observer,
        general_coulomb_observer,
    )
    from .blocks.controllers import (  # noqa: F401
        compensation,
        error,
        feedforward,
        pi,
        pid,
        prefilter,
    )
    from .blocks.delayed import (  # noqa: F401
        coulomb_compensation,
        coulomb_predictor,
        smith_velocity,
    )
    from .blocks.drive import (  # noqa: F401
        current_lag,
        dead_time,
        limiter,
        notch,
        proportional,
    )
    from .blocks.learning import repetitive_control, repetitive_memory  # noqa: F401
    from .blocks.library import effect, friction  # noqa: F401
    from .blocks.observers import (  # noqa: F401
        existing_observer,
        natural_observer,
        proposed_observer,
    )
    from .blocks.plant import plant, sensor  # noqa: F401
    from .blocks.position_observers import (  # noqa: F401
        position_coulomb_observer,
        position_lugre_observer,
    )
    from .blocks.sliding import (  # noqa: F401
        adaptive_slotine_li,
        backstepping_smc,
        dual_observer_control,
        sliding_error,
        slotine_li,
    )
    from .blocks.table import tabulated  # noqa: F401
    from .bristles import deflection  # noqa: F401
    from .cascade import cascade_loop  # noqa: F401
    from .catalogue import controllers, effects, laws, observers  # noqa: F401
    from .comparing import (  # noqa: F401
        ObserverComparison,
        Recommendation,
        compare_observers,
        recommend_observer,
    )
    from .compensating import Compensation, compensate  # noqa: F401
    from .design import (  # noqa: F401
        PAPER,
        Certificate,
        Design,
        ObserverDesign,
        certify,
        design_gains,
        excitation,
        natural_decay,
    )
    from .diagnosis.asking import balance  # noqa: F401
    from .diagnosis.diagnose import diagnose  # noqa: F401
    from .diagnosis.identify import identify  # noqa: F401
    from .diagnosis.laws import LawComparison, compare_laws  # noqa: F401
    from .engine.adaptive import Diverged  # noqa: F401
    from .ensemble import Sweep, sweep, sweep_chunks  # noqa: F401
    from .errors import InputError, Refused  # noqa: F401
    from .fleet import Fleet, diagnose_each  # noqa: F401
    from .linear import (  # noqa: F401
        bandwidth,
        bandwidth_check,
        check_designs,
        l2_check,
        position_loop_tf,
        position_T,
        spr_check,
        spr_repair,
        velocity_loop_tf,
        velocity_T,
    )
    from .loops import position_loop, velocity_loop  # noqa: F401
    from .mixed import simulate_sampled  # noqa: F401
    from .model import Model, Parameters, table1  # noqa: F401
    from .model_file import read_model, write_model  # noqa: F401
    from .record import Record, read_record  # noqa: F401
    from .results import Diagnosis, Table  # noqa: F401
    from .sampling import sampled  # noqa: F401
    from .simulation import simulate  # noqa: F401
    from .spec import P, block  # noqa: F401
