"""Friction in servo drives: blocks for python-control, observers, checks, and diagnosis of logs.

Names are loaded on first use, so that the command line starts quickly; __init__.pyi has them for
editors and type checkers.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOMES = {
    "commissioning.of_record": "frequency_response response_plan",
    "commissioning.tuning": "tune",
    "blocks.block": "P",
    "blocks.declaration": "block load_blocks",
    "blocks.controllers": "compensation current_lag dead_time error feedforward limiter notch pi "
    "pid prefilter proportional",
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
    "blocks.catalogue": "controllers effects laws observers",
    "bench.assure": "Assurance HuntingChance assure hunting_chance",
    "bench.compensate": "Compensation compensate",
    "bench.observers": "ObserverComparison Recommendation compare_observers recommend_observer",
    "hunting.hunt": "LimitCycles limit_cycles",
    "hunting.loop": "HuntingMap hunting_map",
    "hunting.stick_slip": "StickSlip stick_slip_speed",
    "paper.equations": "PAPER",
    "design": "Certificate Design ObserverDesign certify design_gains excitation natural_decay",
    "diagnosis.asked": "balance",
    "diagnosis.diagnose": "diagnose identify",
    "simulation.sweep": "Sweep sweep sweep_chunks",
    "core.errors": "Diverged InputError Refused",
    "diagnosis.fleet": "Fleet diagnose_each",
    "diagnosis.compare_laws": "LawComparison compare_laws",
    "linear": "DelayedTransfer bandwidth bandwidth_check check_designs delayed l2_check linearize "
    "passivity_check position_L position_T position_loop_tf spr_check spr_repair stability_check "
    "velocity_L velocity_T velocity_loop_tf",
    "loops.friction_loops": "cascade_loop late_loop position_loop velocity_loop",
    "blocks.model": "Model Parameters read_model table1 write_model",
    "record": "Record read_record",
    "diagnosis.result": "Diagnosis",
    "estimates.findings": "Table",
    "simulation.sampled_block": "deflection sampled",
    "simulation.response": "simulate simulate_sampled",
}
_HOME = {name: home for home, names in _HOMES.items() for name in names.split()}

__all__ = sorted([*_HOME, "__version__"])


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
