"""The linear checks show themselves: what was decided stands in the picture."""

from __future__ import annotations

import pickle

import control as ct
import matplotlib
import numpy as np
import pytest

import lugrectl as lg

matplotlib.use("agg")
import matplotlib.pyplot as plt  # noqa: E402

P = lg.table1()
LAG = ct.tf([2], [0.5, 1])
FALLS = ct.tf([1, 10], [1, 2, 0.5])  # Re T < 0 above its band edge
SYSTEMS = {
    "tf": FALLS,
    "ss": ct.ss(FALLS),
    "pair": ([1, 10], [1, 2, 0.5]),
    "frd": ct.frd(FALLS, np.logspace(-2, 2, 200)),
}
CHECKS = {"spr": lg.spr_check, "l2": lg.l2_check, "bandwidth": lg.bandwidth_check}


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def words(ax):
    legend = ax.get_legend()
    texts = legend.get_texts() if legend else ()
    return " ".join([ax.get_title("left"), *(t.get_text() for t in texts)])


@pytest.mark.parametrize("T", SYSTEMS.values(), ids=SYSTEMS)
@pytest.mark.parametrize("check", CHECKS.values(), ids=CHECKS)
def test_every_verdict_draws_a_figure_of_pyplot(check, T):
    axes = check(T).plot()
    assert plt.get_fignums() == [axes[0].figure.number]
    assert all(len(ax.lines) and len(ax.lines[0].get_xdata()) > 100 for ax in axes)


def test_realness_shows_band_edge_and_margin():
    found = lg.spr_check(FALLS)
    (real,) = found.plot()
    assert f"band edge {found.band_edge:.4g} rad/s" in words(real) and "not PR" in words(real)
    assert "margin" not in real.get_title("left")
    w, values = real.lines[0].get_data()
    assert (values[w < 0.99 * found.band_edge] > 0).all()
    assert (values[w > 1.01 * found.band_edge] < 0).all()
    assert real.get_ylabel() == "Re T(jw)"
    good = lg.spr_check(ct.tf([1, 2], [1, 4, 5]))
    assert good and f"margin {good.margin:.4g}" in good.plot()[0].get_title("left")


def test_the_gain_shows_its_largest_value():
    for found in (lg.l2_check(P, 22.0), lg.l2_check(ct.tf([100], [1, 2, 100]))):
        (ax,) = found.plot()
        assert f"largest: {found.gain:.4g}" in words(ax)
        assert np.max(ax.lines[0].get_ydata()) == pytest.approx(20 * np.log10(found.gain), abs=0.1)


def test_the_bandwidth_stands_in_the_bode_plot():
    found = lg.bandwidth_check(LAG)
    (ax,) = found.plot()
    assert f"bandwidth {found.bandwidth:.4g} rad/s" in words(ax)
    x, y = ax.lines[-1].get_data()
    assert (x[0], y[0]) == pytest.approx((found.bandwidth, 20 * np.log10(2) - 3), abs=0.01)


def test_a_verdict_is_drawn_into_given_axes():
    _, ax = plt.subplots()
    assert lg.bandwidth_check(LAG).plot(ax=ax)[0] is ax and len(ax.lines) > 1
    _, two = plt.subplots(1, 2)
    assert len(lg.stability_check(LAG).plot(two)) == 2
    with pytest.raises(lg.InputError, match="ax must be an Axes"):
        lg.spr_check(LAG).plot(3)


@pytest.mark.parametrize("T", [SYSTEMS["tf"], SYSTEMS["pair"], SYSTEMS["frd"]])
def test_a_verdict_is_the_same_after_a_pickle_and_can_be_drawn(T):
    found = lg.spr_check(T)
    again = pickle.loads(pickle.dumps(found))
    assert again.summary().keys() == found.summary().keys() and "_source" not in found.summary()
    assert len(again.plot()) == 1


SAMPLED = ct.sample_system(FALLS, 0.1, "tustin")  # with a zero at half the sampling rate


@pytest.mark.parametrize("T", [ct.ss(SAMPLED), ct.tf([1, 0.2], [1, -0.5], True)])
@pytest.mark.parametrize("check", CHECKS.values(), ids=CHECKS)
def test_a_sampled_verdict_is_drawn_on_the_circle_up_to_half_the_rate(check, T):
    dt = 1.0 if T.dt is True else T.dt
    axes = check(T).plot()
    curve = axes[0].lines[0].get_data()
    assert 0.99 * np.pi / dt < curve[0][-1] <= np.pi / dt
    at = np.array([T(np.exp(1j * w * dt)) for w in curve[0]])
    wanted = at.real if check is lg.spr_check else 20 * np.log10(abs(at))
    assert curve[1] == pytest.approx(wanted, rel=1e-9)
    assert "T(exp(jw dt))" in axes[0].get_ylabel()


def test_a_zero_at_half_the_rate_does_not_squeeze_the_picture():
    (ax,) = lg.l2_check(SAMPLED).plot()
    assert ax.get_ylim()[0] > -180


def test_several_channels_are_drawn_by_their_largest_singular_value():
    T = ct.ss(np.diag([-1.0, -2.0]), np.eye(2), np.eye(2), np.zeros((2, 2)))
    (ax,) = lg.l2_check(T).plot()
    w, size = ax.lines[0].get_data()
    assert size == pytest.approx(-20 * np.log10(np.hypot(1, w)), rel=1e-9, abs=1e-12)
    assert ax.get_ylabel() == "largest singular value of T(jw) [dB]"


def test_the_open_loop_shows_its_crossovers_and_the_exact_phase():
    found = lg.stability_check(lg.delayed(ct.tf([100.0], [1.0, 0.0]), 0.01))
    size, phase, nyquist = found.plot()
    assert f"stable, delay margin {found.delay_margin:.4g} s" in size.get_title("left")
    w, turned = phase.lines[0].get_data()
    assert turned == pytest.approx(-90.0 - np.degrees(0.01 * w), abs=1e-6)
    assert phase.lines[2].get_xdata() == pytest.approx([100.0])
    assert "-1" in words(nyquist)


@pytest.mark.parametrize("check", CHECKS.values(), ids=CHECKS)
def test_the_plots_show_the_exact_response_of_a_dead_time(check):
    T = lg.delayed(ct.tf([100.0], [1.0, 0.0]), 0.01).feedback()
    axes = check(T).plot()
    w, values = axes[0].lines[0].get_data()
    exact = T(1j * w)
    wanted = exact.real if check is lg.spr_check else 20 * np.log10(np.abs(exact))
    assert values == pytest.approx(wanted, rel=1e-9, abs=1e-9)


def test_the_nyquist_picture_shows_the_margins():
    resonant = lg.delayed(ct.tf([2, 20], [1, 1, 50, 0]), 0.05)
    found = lg.stability_check(resonant)
    size, phase, nyquist = found.plot()
    for k in ("gain", "phase", "modulus"):
        at = getattr(found, f"{k}_margin_frequency")
        assert f"{k} margin {getattr(found, f'{k}_margin'):.4g}" in words(nyquist)
        assert f"at {at:.4g} rad/s" in words(nyquist)
    ring = nyquist.lines[-1].get_xydata() @ [1, 1j]
    curve = nyquist.lines[0].get_xydata() @ [1, 1j]
    assert abs(1 + ring) == pytest.approx(found.modulus_margin * np.ones(len(ring)))
    assert np.nanmin(abs(1 + curve)) == pytest.approx(found.modulus_margin, rel=1e-6)
    assert f"gain margin {20 * np.log10(found.gain_margin):.4g} dB" in words(size)
    bar = phase.lines[-1].get_ydata()
    w, turned = phase.lines[0].get_data()
    assert np.interp(found.phase_margin_frequency, w, turned) == pytest.approx(bar[1], abs=1e-3)
    assert bar[1] - bar[0] == pytest.approx(found.phase_margin)


@pytest.mark.parametrize("L", [ct.sample_system(ct.tf([2], [1, 1, 0]), 0.1), SYSTEMS["frd"]])
def test_sampled_and_measured_loops_are_drawn_with_their_margins(L):
    found = lg.stability_check(L)
    size, _, nyquist = found.plot()
    assert found and "modulus margin" in words(nyquist)
    assert ("L(exp(jw dt))" in size.get_ylabel()) == hasattr(L, "poles")


def test_passivity_shows_the_speed_from_which_friction_may_give_energy():
    found = lg.passivity_check(P)
    (ax,) = found.plot()
    w, power = ax.lines[0].get_data()
    assert (power[w < 0.99 * found.speed] > 0).all() and (power[w > 1.01 * found.speed] < 0).all()
    assert f"above {found.speed:.4g} rad/s" in words(ax) and "not passive" in words(ax)
