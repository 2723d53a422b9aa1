"""The public names; python -m tests.house.stub writes this file."""

from collections.abc import Sequence

import control as ct

from . import results as results
from .bench.assure import Assurance as Assurance
from .bench.assure import HuntingChance as HuntingChance
from .bench.assure import assure as assure
from .bench.assure import hunting_chance as hunting_chance
from .bench.compensate import Compensation as Compensation
from .bench.compensate import compensate as compensate
from .bench.observers import ObserverComparison as ObserverComparison
from .bench.observers import Recommendation as Recommendation
from .bench.observers import compare_observers as compare_observers
from .bench.observers import recommend_observer as recommend_observer
from .blocks.block import P as P
from .blocks.catalogue import controllers as controllers
from .blocks.catalogue import effects as effects
from .blocks.catalogue import laws as laws
from .blocks.catalogue import observers as observers
from .blocks.controllers import compensation as compensation
from .blocks.controllers import current_lag as current_lag
from .blocks.controllers import dead_time as dead_time
from .blocks.controllers import error as error
from .blocks.controllers import feedforward as feedforward
from .blocks.controllers import pi as pi
from .blocks.controllers import pid as pid
from .blocks.controllers import prefilter as prefilter
from .blocks.declaration import block as block
from .blocks.declaration import load_blocks as load_blocks
from .blocks.factories import effect as effect
from .blocks.factories import friction as friction
from .blocks.model import Model as Model
from .blocks.model import Parameters as Parameters
from .blocks.model import read_model as read_model
from .blocks.model import table1 as table1
from .blocks.model import write_model as write_model
from .blocks.observers import Gain
from .blocks.plant import plant as plant
from .blocks.plant import sensor as sensor
from .blocks.sliding_control import repetitive_control as repetitive_control
from .blocks.sliding_control import repetitive_memory as repetitive_memory
from .blocks.sliding_control import sliding_error as sliding_error
from .blocks.table import tabulated as tabulated
from .commissioning.of_record import frequency_response as frequency_response
from .commissioning.of_record import response_plan as response_plan
from .commissioning.tuning import tune as tune
from .core.errors import Diverged as Diverged
from .core.errors import InputError as InputError
from .core.errors import Refused as Refused
from .design import Certificate as Certificate
from .design import Design as Design
from .design import ObserverDesign as ObserverDesign
from .design import certify as certify
from .design import design_gains as design_gains
from .design import excitation as excitation
from .design import natural_decay as natural_decay
from .diagnosis.asked import balance as balance
from .diagnosis.compare_laws import LawComparison as LawComparison
from .diagnosis.compare_laws import compare_laws as compare_laws
from .diagnosis.diagnose import diagnose as diagnose
from .diagnosis.diagnose import identify as identify
from .diagnosis.fleet import Fleet as Fleet
from .diagnosis.fleet import diagnose_each as diagnose_each
from .diagnosis.result import Diagnosis as Diagnosis
from .estimates.findings import Table as Table
from .hunting.hunt import LimitCycles as LimitCycles
from .hunting.hunt import limit_cycles as limit_cycles
from .hunting.loop import HuntingMap as HuntingMap
from .hunting.loop import hunting_map as hunting_map
from .hunting.stick_slip import StickSlip as StickSlip
from .hunting.stick_slip import stick_slip_speed as stick_slip_speed
from .linear import DelayedTransfer as DelayedTransfer
from .linear import bandwidth as bandwidth
from .linear import bandwidth_check as bandwidth_check
from .linear import check_designs as check_designs
from .linear import delayed as delayed
from .linear import l2_check as l2_check
from .linear import linearize as linearize
from .linear import passivity_check as passivity_check
from .linear import position_L as position_L
from .linear import position_loop_tf as position_loop_tf
from .linear import position_T as position_T
from .linear import spr_check as spr_check
from .linear import spr_repair as spr_repair
from .linear import stability_check as stability_check
from .linear import velocity_L as velocity_L
from .linear import velocity_loop_tf as velocity_loop_tf
from .linear import velocity_T as velocity_T
from .loops.friction_loops import cascade_loop as cascade_loop
from .loops.friction_loops import late_loop as late_loop
from .loops.friction_loops import position_loop as position_loop
from .loops.friction_loops import velocity_loop as velocity_loop
from .paper.equations import PAPER as PAPER
from .record import Record as Record
from .record import read_record as read_record
from .simulation.response import simulate as simulate
from .simulation.response import simulate_sampled as simulate_sampled
from .simulation.sampled_block import deflection as deflection
from .simulation.sampled_block import sampled as sampled
from .simulation.sweep import Sweep as Sweep
from .simulation.sweep import sweep as sweep
from .simulation.sweep import sweep_chunks as sweep_chunks

__version__: str
__all__: list[str]

def adaptive_observer(
    p: Parameters | Model,
    K2: Gain = 1.0,
    gamma: Gain = 10.0,
    *,
    name: str = "adaptive_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """LuGre with an unknown constant scale: inputs w, u, outputs Fhat, zhat, what, scale."""

def adaptive_slotine_li(
    KD: Gain = 0.1,
    gJ: Gain = 0.0001,
    gv: Gain = 0.01,
    gc: Gain = 0.3,
    *,
    name: str = "adaptive_slotine_li",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """Slotine-Li with adaptation from nothing: inputs s, ar, w, output u."""

def backstepping_smc(
    p: Parameters | Model,
    ks: Gain = 100.0,
    eps: Gain = 5.0,
    *,
    name: str = "backstepping_smc",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    **gains: Gain,
) -> ct.NonlinearIOSystem:
    """Backstepping with an integral fast terminal sliding mode: inputs s, ar, outputs u, surface."""

def coulomb_compensation(
    p: Parameters | Model,
    *,
    name: str = "coulomb_compensation",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The friction at the predicted velocity: inputs ws, ahat, output u."""

def coulomb_predictor(
    p: Parameters | Model,
    *,
    name: str = "coulomb_predictor",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """A drive with the Coulomb friction that an observer has found: inputs u, ahat, output wp."""

def disturbance_observer(
    p: Parameters | Model,
    tau: Gain = 0.01,
    *,
    name: str = "disturbance_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The disturbance observer Fhat = (u - J dw/dt) / (tau s + 1): inputs w, u, output Fhat."""

def dual_observer_control(
    p: Parameters | Model,
    KD: Gain = 0.1,
    *,
    name: str = "dual_observer_control",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    **gains: Gain,
) -> ct.NonlinearIOSystem:
    """State feedback that adapts sigma0, sigma1 and Fv: inputs s, ar, w, output u."""

def existing_observer(
    p: Parameters | Model,
    k: Gain = 0.35,
    *,
    name: str = "existing_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The observer of Canudas de Wit et al. 1995: inputs w, e, outputs Fhat, zhat."""

def extended_state_observer(
    p: Parameters | Model,
    bandwidth: Gain = 100.0,
    *,
    name: str = "extended_state_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The linear extended-state observer: inputs w, u, outputs Fhat, what."""

def friction_state_observer(
    p: Parameters | Model,
    bandwidth: Gain = 500.0,
    *,
    name: str = "friction_state_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """Friction as a state with presliding in its rate: inputs w, u, outputs Fhat, what."""

def friedland_park_observer(
    p: Parameters | Model,
    k: Gain = 0.1,
    mu: Gain = 1.5,
    *,
    name: str = "friedland_park_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The Coulomb friction observer of Friedland and Park: inputs w, u, outputs Fhat, ahat."""

def general_coulomb_observer(
    p: Parameters | Model,
    k: Gain = 0.11,
    w0: Gain = 0.1,
    *,
    name: str = "general_coulomb_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """Friedland-Park with an adaptation that saturates: inputs w, u, outputs Fhat, ahat."""

def limiter(
    limit: Gain = ...,
    *,
    name: str = "limiter",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The torque limit of a drive: input u_cmd, outputs u, excess."""

def lyapunov_observer(
    p: Parameters | Model,
    k: Gain = 0.35,
    *,
    name: str = "lyapunov_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The observer with a proof at every speed: inputs w, s, outputs Fhat, zhat."""

def natural_observer(
    p: Parameters | Model,
    *,
    name: str = "natural_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The LuGre law itself, run on the measured velocity: input w, outputs Fhat, zhat."""

def normal_force_observer(
    p: Parameters | Model,
    k: Gain = 1.0,
    gamma: Gain = 2000.0,
    *,
    name: str = "normal_force_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """LuGre scaled as by a normal force: inputs w, e, outputs Fhat, zhat, scale."""

def notch(
    frequency: Gain,
    damping: Gain = 0.5,
    depth: Gain = 0.1,
    *,
    name: str = "notch",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """A notch filter against a resonance: input u_cmd, output u."""

def position_coulomb_observer(
    p: Parameters | Model,
    k: Gain = 0.11,
    L: Gain = 400.0,
    *,
    name: str = "position_coulomb_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """Coulomb friction and velocity from the position: inputs theta, u, outputs Fhat, ahat, what."""

def position_lugre_observer(
    p: Parameters | Model,
    l1: Gain = 900.0,
    l2: Gain = 200000.0,
    l3: Gain = -100.0,
    *,
    name: str = "position_lugre_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The whole drive copied and corrected by the position: inputs theta, u."""

def proportional(
    kv: Gain = 20.0,
    limit: Gain = ...,
    *,
    name: str = "proportional",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The position controller of a cascade, w_ref = kv (-e): input e, output w_ref."""

def proposed_observer(
    p: Parameters | Model,
    K1: Gain = -10.24,
    K2: Gain = 22.0,
    *,
    name: str = "proposed_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The source paper's observer: inputs w, u, outputs Fhat, zhat, what."""

def slotine_li(
    p: Parameters | Model,
    KD: Gain = 0.1,
    *,
    name: str = "slotine_li",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The controller u = J ar - KD s: inputs s, ar of :func:`sliding_error`, output u."""

def smith_velocity(
    *,
    name: str = "smith_velocity",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The predicted velocity with the measured error of the prediction: inputs w, wp, wp_late."""

def temperature_observer(
    p: Parameters | Model,
    k: Gain = 0.0,
    gamma: Gain = 5.0,
    *,
    name: str = "temperature_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """LuGre with an unknown level h(w), as by temperature: inputs w, u, outputs Fhat, zhat, slip."""
