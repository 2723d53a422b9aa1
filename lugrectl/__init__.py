"""Friction in servo drives: blocks for python-control, observers, checks, and diagnosis of logs.

Names are loaded on first use, so that the command line starts quickly.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOMES = {
    "commissioning": "frequency_response response_plan tune",
    "blocks.block": "P",
    "blocks.declaration": "block load_blocks",
    "blocks.controllers": "compensation error feedforward pi pid prefilter",
    "blocks.drive": "current_lag dead_time limiter notch proportional",
    "blocks.factories": "effect friction",
    "blocks.observers": "adaptive_observer disturbance_observer existing_observer "
    "extended_state_observer friction_state_observer friedland_park_observer "
    "general_coulomb_observer lyapunov_observer natural_observer normal_force_observer "
    "position_coulomb_observer position_lugre_observer proposed_observer temperature_observer",
    "blocks.plant": "plant sensor",
    "blocks.sliding_control": "adaptive_slotine_li backstepping_smc coulomb_compensation "
    "coulomb_predictor dual_observer_control repetitive_control repetitive_memory sliding_error "
    "slotine_li smith_velocity",
    "blocks.table": "tabulated",
    "simulation.bristle_deflection": "deflection",
    "blocks.catalogue": "controllers effects laws observers",
    "bench": "Assurance Compensation HuntingChance ObserverComparison Recommendation assure "
    "compare_observers compensate hunting_chance recommend_observer",
    "hunting": "HuntingMap LimitCycles StickSlip hunting_map limit_cycles stick_slip_speed",
    "paper.equations": "PAPER",
    "design": "Certificate Design ObserverDesign certify design_gains excitation natural_decay",
    "diagnosis.asked": "balance",
    "diagnosis.diagnose": "diagnose identify",
    "simulation.sweep": "sweep sweep_chunks",
    "simulation.sweep_result": "Sweep",
    "core.errors": "Diverged InputError Refused",
    "diagnosis.fleet": "Fleet diagnose_each",
    "diagnosis.compare_laws": "LawComparison compare_laws",
    "linear": "DelayedTransfer bandwidth bandwidth_check check_designs delayed l2_check linearize "
    "passivity_check position_L position_T position_loop_tf spr_check spr_repair stability_check "
    "velocity_L velocity_T velocity_loop_tf",
    "loops.friction_loops": "cascade_loop late_loop position_loop velocity_loop",
    "simulation.sampled_response": "simulate_sampled",
    "blocks.model": "Model Parameters read_model table1 write_model",
    "record": "Record read_record",
    "diagnosis.result": "Diagnosis",
    "estimates.findings": "Table",
    "simulation.sampled_block": "sampled",
    "simulation.response": "simulate",
}
_HOME = {name: home for home, names in _HOMES.items() for name in names.split()}

__all__ = sorted([*_HOME, "__version__"])  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name == "results":
        return import_module(".results", __name__)
    if name not in _HOME:
        raise AttributeError(f"module 'lugrectl' has no attribute '{name}'")
    value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__


if TYPE_CHECKING:
    from .bench import (
        Assurance,
        Compensation,
        HuntingChance,
        ObserverComparison,
        Recommendation,
        assure,
        compare_observers,
        compensate,
        hunting_chance,
        recommend_observer,
    )
    from .blocks.block import P
    from .blocks.catalogue import controllers, effects, laws, observers
    from .blocks.controllers import compensation, error, feedforward, pi, pid, prefilter
    from .blocks.declaration import block, load_blocks
    from .blocks.drive import current_lag, dead_time, limiter, notch, proportional
    from .blocks.factories import effect, friction
    from .blocks.model import Model, Parameters, read_model, table1, write_model
    from .blocks.observers import (
        adaptive_observer,
        disturbance_observer,
        existing_observer,
        extended_state_observer,
        friction_state_observer,
        friedland_park_observer,
        general_coulomb_observer,
        lyapunov_observer,
        natural_observer,
        normal_force_observer,
        position_coulomb_observer,
        position_lugre_observer,
        proposed_observer,
        temperature_observer,
    )
    from .blocks.plant import plant, sensor
    from .blocks.sliding_control import (
        adaptive_slotine_li,
        backstepping_smc,
        coulomb_compensation,
        coulomb_predictor,
        dual_observer_control,
        repetitive_control,
        repetitive_memory,
        sliding_error,
        slotine_li,
        smith_velocity,
    )
    from .blocks.table import tabulated
    from .commissioning import frequency_response, response_plan, tune
    from .core.errors import Diverged, InputError, Refused
    from .design import (
        Certificate,
        Design,
        ObserverDesign,
        certify,
        design_gains,
        excitation,
        natural_decay,
    )
    from .diagnosis.asked import balance
    from .diagnosis.compare_laws import LawComparison, compare_laws
    from .diagnosis.diagnose import diagnose, identify
    from .diagnosis.fleet import Fleet, diagnose_each
    from .diagnosis.result import Diagnosis
    from .estimates.findings import Table
    from .hunting import (
        HuntingMap,
        LimitCycles,
        StickSlip,
        hunting_map,
        limit_cycles,
        stick_slip_speed,
    )
    from .linear import (
        DelayedTransfer,
        bandwidth,
        bandwidth_check,
        check_designs,
        delayed,
        l2_check,
        linearize,
        passivity_check,
        position_L,
        position_loop_tf,
        position_T,
        spr_check,
        spr_repair,
        stability_check,
        velocity_L,
        velocity_loop_tf,
        velocity_T,
    )
    from .loops.friction_loops import cascade_loop, late_loop, position_loop, velocity_loop
    from .paper.equations import PAPER
    from .record import Record, read_record
    from .simulation.bristle_deflection import deflection
    from .simulation.response import simulate
    from .simulation.sampled_block import sampled
    from .simulation.sampled_response import simulate_sampled
    from .simulation.sweep import sweep, sweep_chunks
    from .simulation.sweep_result import Sweep
