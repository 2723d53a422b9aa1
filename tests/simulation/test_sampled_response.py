"""A continuous plant under sampled control against closed forms and the continuous loop."""

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.loops.friction_loops import velocity_loop
from lugrectl.simulation.response import simulate, simulate_sampled
from lugrectl.simulation.sampled_block import sampled

from ..cases.own import row, static, user_block

P, DT = lg.table1(), 1e-3


def integrator():
    """dw/dt = u - d."""
    return user_block(
        lambda t, x, u, p: np.array([u[0] - u[1]]),
        lambda t, x, u, p: np.array([x[0]]),
        ["u", "d"],
        ["w"],
        ["w"],
        "integrator",
    )


def gain(k):
    """u = k (r - w)."""
    return static(lambda t, x, u, p: np.array([k * (u[0] - u[1])]), ["r", "w"], ["u"], "gain")


def drive(dt, *observers):
    parts = [sampled(lg.pi(1.6, 0.16), dt), *(sampled(o, dt) for o in observers)]
    return [lg.error(), lg.compensation(), *parts]


@pytest.mark.parametrize("k", [0.5, 1.5, 1.9])
def test_held_torque_on_an_integrator_is_a_geometric_series(k):
    t = 0.1 * np.arange(30)
    resp = simulate_sampled(integrator(), [gain(k / 0.1)], t, 1.0)
    assert row(resp, "w") == pytest.approx(1 - (1 - k) ** np.arange(30), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("k", "delay", "quiet"), [(1.8, 0, True), (1.1, 1, False), (0.9, 1, True)])
def test_a_delay_of_one_sample_halves_the_highest_gain(k, delay, quiet):
    """Stable for k dt < 2 without and k dt < 1 with a sample of delay."""
    t = 0.1 * np.arange(300)
    resp = simulate_sampled(integrator(), [gain(k / 0.1)], t, 1.0, delay=delay)
    error = np.abs(row(resp, "w")[-20:] - 1.0).max()
    assert (error < 1e-3) == quiet and (error > 1e3) != quiet


def test_delay_moves_the_torque():
    t = 0.1 * np.arange(8)
    for delay in (0, 1, 3):
        w = row(simulate_sampled(integrator(), [gain(0.1)], t, 1.0, delay=delay), "w")
        assert np.flatnonzero(w)[0] == 1 + delay


@pytest.mark.parametrize("name", ["natural", "proposed"])
def test_converges_to_the_continuous_loop(name):
    """Source paper's velocity loop, Fc and Fs of the observer 20 % low: order one in dt."""
    low = lg.Parameters(**{**vars(P), "Fc": 0.8 * P.Fc, "Fs": 0.8 * P.Fs})
    make = {
        "natural": lg.natural_observer,
        "proposed": lg.proposed_observer,
    }[name]
    t = 2e-3 * np.arange(101)
    whole = simulate(
        velocity_loop(P, name, observer_parameters=low), t, 0.1 * np.sin(2 * np.pi * t)
    )

    def error(dt):
        fine = dt * np.arange(round(t[-1] / dt) + 1)
        resp = simulate_sampled(
            lg.plant(P), drive(dt, make(low)), fine, 0.1 * np.sin(2 * np.pi * fine)
        )
        return np.abs(row(resp, "w")[:: round(2e-3 / dt)] - row(whole, "w")).max()

    coarse, fine = error(1e-3), error(2.5e-4)
    assert fine < 0.45 * coarse and fine < 2e-3


def test_a_run_can_go_on_from_its_last_state():
    t = DT * np.arange(81)
    r = 0.1 * np.sin(20 * t)
    parts = drive(DT, lg.proposed_observer(P))
    whole = simulate_sampled(lg.plant(P), parts, t, r)
    x, s = np.split(whole.states[:, 40], [3])
    rest = simulate_sampled(lg.plant(P), parts, t[40:], r[40:], x, drive_x0=s)
    np.testing.assert_allclose(rest.outputs[0], whole.outputs[0, 40:], rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("delay", [0, 2])
def test_a_number_for_the_states_of_the_drive_leaves_the_delay_at_zero(delay):
    """The plant stands until the first command arrives; a list goes on from any state."""
    t, parts = 0.1 * np.arange(6), [sampled(lg.pi(0.0, 1.0, inputs=["w"]), 0.1)]
    found = simulate_sampled(integrator(), parts, t, drive_x0=1.0, delay=delay)
    assert np.flatnonzero(row(found, "w"))[0] == 1 + delay
    x, s = np.split(found.states[:, 3], [1])
    rest = simulate_sampled(integrator(), parts, t[3:], x0=x, drive_x0=s, delay=delay)
    np.testing.assert_allclose(row(rest, "w"), row(found, "w")[3:], rtol=1e-6)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda t: simulate_sampled(lg.plant(P), [lg.pi()], t), "continuous-time"),
        (lambda t: simulate_sampled(lg.plant(P), drive(2 * DT), t), "steps of"),
        (
            lambda t: simulate_sampled(lg.plant(P), [lg.compensation()], t),
            "connected by signal names",
        ),
        (
            lambda t: simulate_sampled(integrator(), [gain(1.0)], t, {"q": 1.0}),
            "no external input 'q'",
        ),
        (
            lambda t: simulate_sampled(integrator(), [gain(1.0)], t, [t, t]),
            r"the drive needs inputs \(r\) of shape \(1, 5\), not \(5,\) and \(5,\)",
        ),
        (
            lambda t: simulate_sampled(integrator(), [gain(1.0)], t, t[1:]),
            r"the drive needs inputs \(r\) of shape \(1, 5\), not \(4,\)",
        ),
        (lambda t: simulate_sampled(integrator(), [gain(1.0)], t, delay=-1), "delay"),
        (lambda t: simulate_sampled(integrator(), [gain(1.0)], t, x0=[1, 2]), "1 states"),
        (
            lambda t: simulate_sampled(
                lg.plant(P), [*drive(DT), sampled(lg.natural_observer(P), 2 * DT)], t
            ),
            "different sample times",
        ),
    ],
)
def test_parts_that_do_not_fit_are_said(call, said):
    with pytest.raises(lg.InputError, match=said):
        call(DT * np.arange(5))


def test_an_algebraic_loop_is_refused():
    again = static(
        lambda t, x, u, p: np.array([u[1] - 2.0 * np.tanh(u[0])]), ["u", "w"], ["u"], "again"
    )
    with pytest.raises(lg.InputError, match="depends on itself"):
        simulate_sampled(integrator(), [again], DT * np.arange(5), x0=[1.0])


def test_an_untraceable_drive_block_is_fine():
    """A quantiser with a Python branch: discrete blocks are called, not traced."""
    bang = static(lambda t, x, u, p: np.array([-1.0 if u[0] > 0 else 1.0]), ["w"], ["u"], "bang")
    w = row(simulate_sampled(integrator(), [bang], 0.1 * np.arange(9), x0=[0.25]), "w")
    assert w == pytest.approx([0.25, 0.15, 0.05, -0.05, 0.05, -0.05, 0.05, -0.05, 0.05])
