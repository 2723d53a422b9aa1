"""What goes in and comes out: channels, refusals, plain data, the picture, the command."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.cli import main
from lugrectl.commissioning.of_record import UncertainResponseWarning, unwrapped
from lugrectl.linear import AxisAsLoopWarning

J, Fc = 0.02, 0.3
MODEL = lg.Model.of(friction="coulomb")
BODE = ["bode", "run.csv", "--model", "my.toml"]


def log(n=4000, dt=2e-3, bias=0.0):
    """A rigid axis with Coulomb friction, jogged with noise on top; each torque is held."""
    t, rng = dt * np.arange(n), np.random.default_rng(0)
    w = bias + 10 * np.sin(20 * t) + np.convolve(rng.normal(0, 2, n), np.ones(5), "same")
    after = np.append(w[1:], w[-1])
    return {"t": t, "u": J * (after - w) / dt + Fc * np.sign(w + after), "w": w}


@pytest.fixture(scope="module")
def found():
    return lg.frequency_response(log(), MODEL)


def test_a_log_of_speed_answers(found):
    body = np.abs(found.frequency * J * found.magnitude - 1)
    assert np.median(body[found.frequency < 60]) < 0.03
    assert found.friction["Fc"] == pytest.approx(Fc, rel=0.05)


def test_it_is_an_frd_of_the_sampled_axis(found):
    assert isinstance(found.frd, ct.FrequencyResponseData) and found.frd.dt == pytest.approx(2e-3)
    assert np.allclose(np.abs(found.frd.frdata[0, 0]), found.magnitude)
    assert np.allclose(np.exp(1j * found.phase), np.exp(1j * np.angle(found.frd.frdata[0, 0])))
    assert isinstance(found, lg.results.FrequencyResponse)


def test_it_is_one_itself_of_a_loop_with_the_controller(found):
    C = ct.tf([0.5, 2.0], [1.0, 0.0])
    assert isinstance(found, ct.FrequencyResponseData) and found.dt == pytest.approx(2e-3)
    assert found.certain.all() and lg.stability_check(C * found).stable
    unsure = replace(found, coherence=np.where(found.frequency < 100, found.coherence, 0.5))
    for product in (lambda: C * unsure, lambda: unsure * C):
        with pytest.warns(UncertainResponseWarning, match="points of the response are not certain"):
            L = product()
        assert np.allclose(L.frdata, (found.frd * C).frdata)
        assert lg.stability_check(L).phase_margin > 0
    with pytest.warns(AxisAsLoopWarning, match="of an axis, and no loop"):
        lg.stability_check(found)
    again = pickle.loads(pickle.dumps(found))
    assert np.array_equal(again.magnitude, found.magnitude) and str(again) == repr(found)
    axes = ct.bode_plot(found).axes
    plt.close(axes[0, 0].figure)


def test_plain_data_and_a_short_text(found):
    made = json.loads(found.to_json())
    keys = ("frequency", "magnitude", "phase", "low", "high", "coherence")
    assert {len(made[k]) for k in keys} == {len(found.frequency)}
    assert made["gains"] is None and made["modes"] == [m.summary() for m in found.modes]
    assert "kg m2" in repr(found) and len(repr(found).splitlines()) < 15


def test_an_axis_that_never_reverses_keeps_its_response():
    found = lg.frequency_response(log(2000, bias=40.0), MODEL)
    assert np.array_equal(found.frd.frdata, found.raw.frdata)
    assert any("never reverses" in one for one in found.messages)


@pytest.mark.slow
def test_a_log_that_shows_nothing_is_refused():
    t = 2e-3 * np.arange(8000)
    w = 10 * np.sin(2 * t)  # below the lowest frequency
    noise = np.random.default_rng(1).normal(0, 0.05, (2, 8000))
    one = {"t": t, "u": J * np.gradient(w, t) + Fc * np.sign(w) + noise[0], "w": w + noise[1]}
    with pytest.raises(lg.Refused, match="certain at no frequency") as no:
        lg.frequency_response(one, MODEL)
    assert "multisine" in str(no.value.experiment)
    assert "excites the axis too little" in str(no.value) and "record 30 s" in str(no.value)


def three_sines(n=12000, dt=1e-3, steps=5):
    """A rigid axis with Fc and a PI loop of its speed, whose reference is three sines."""
    t, noise = dt * np.arange(n), 1e-4 * np.random.default_rng(0).standard_normal(n)
    r = sum(5 * np.sin(2 * np.pi * f * t + f) for f in (0.7, 2.3, 6.1))
    u, w = np.zeros(n), np.zeros(n)
    speed = total = 0.0
    for k in range(n):
        w[k] = speed + noise[k]
        for _ in range(steps):
            speed += dt / steps * (u[k] - 0.1 * np.tanh(speed / 0.02) - 0.02 * speed) / 0.01
        total += 6.0 * dt * (r[k] - w[k])
        u[min(k + 1, n - 1)] = 0.6 * (r[k] - w[k]) + total
    return {"t": t, "u": u, "w": w, "r": r}


@pytest.mark.parametrize("channels, most", [("tuw", 2), ("tuwr", 0)])
def test_the_controller_is_not_read_as_the_axis(channels, most):
    """Between the lines friction moves the axis, and u/w there is that of the controller."""
    made = three_sines()
    found = lg.frequency_response({k: made[k] for k in channels}, lg.Model.of())
    true = np.abs(1 / (0.01j * found.frequency + 0.02))
    wrong = np.abs(np.log10(found.magnitude / true)) > 0.3
    assert wrong.sum() > 40
    assert (found.certain & wrong).sum() <= most


def test_no_friction_is_taken_out_where_none_shows():
    one = log(2000)
    one["u"] = J * np.gradient(one["w"], one["t"]) + 0.1 * one["w"]
    found = lg.frequency_response(one, MODEL)
    assert found.friction == {} and found.messages[0].startswith("No dry friction")
    assert np.array_equal(found.frd.frdata, found.raw.frdata)


def test_the_phase_is_unwrapped_along_what_is_certain():
    w, sure = np.arange(1.0, 41.0), np.arange(40) % 3 == 0
    true = -0.3 * w
    angle = true + np.where(sure, 0.0, np.random.default_rng(0).uniform(-3, 3, 40))
    made = unwrapped(w, np.exp(1j * angle), sure)
    assert np.allclose((made - true)[sure], 0.0) and np.abs(made - true).max() < np.pi + 0.01


def _drift(t, w):
    return {"name": "thermal_drift", "ratio": 5.0, "time_constant": 5.0}, 5 - 5 * np.exp(-t / 5)


def _weight(t, w):
    load = np.sin(np.cumsum(w) * (t[1] - t[0]))
    gravity = {"name": "gravity", "amplitude": 1.0, "phase": 0.0}
    effect = {"name": "load_dependent_friction", "coefficient": 0.3}
    return [gravity, effect], np.abs(load) + load * np.sign(w) / Fc


@pytest.mark.slow
@pytest.mark.parametrize("effect", [_drift, _weight])
def test_effects_on_the_level_of_friction_are_taken_out(effect):
    one = log()
    effects, level = effect(one["t"], one["w"])
    one["u"] = one["u"] + Fc * level * np.sign(one["w"])
    model = lg.Model.of(friction="coulomb", Fc=Fc, Fv=0.0)
    made = [lg.frequency_response(one, x) for x in (model, lg.Model.of(model, effects=effects))]
    left, taken = (np.median(1 - x.coherence[x.frequency < 60]) for x in made)
    assert taken < 0.5 * left


def test_what_cannot_be_taken_out_is_named():
    model = lg.Model.of(friction="coulomb", effects=[{"name": "inertia_step"}])
    assert any(
        "inertia_step is not taken" in m for m in lg.frequency_response(log(1500), model).messages
    )
    with pytest.raises(lg.InputError, match="amplitude, phase must be known"):
        lg.frequency_response(log(), lg.Model.of(friction="coulomb", effects="gravity"))


def test_unfit_logs_are_refused():
    with pytest.raises(lg.Refused, match="longest stretch"):
        lg.frequency_response(log(n=300), MODEL)
    with pytest.raises(lg.InputError, match="one sampling rate"):
        lg.frequency_response([log(), log(dt=1e-3)], MODEL)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    lg.write_model(MODEL, tmp_path / "my.toml")
    for name, n in (("run.csv", 2000), ("short.csv", 300)):
        rows = np.column_stack([*log(n).values()])
        head = "t,u [N m],w [rad/s]"
        np.savetxt(tmp_path / name, rows, "%.9g", ",", header=head, comments="")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_the_command_prints_and_draws(folder, capsys):
    assert main([*BODE, "--out", "bode.png"]) == 0
    said = capsys.readouterr()
    assert said.out.startswith("Frequency response") and "picture: bode.png" in said.err
    assert (folder / "bode.png").stat().st_size > 10_000
    assert main([*BODE, "--json"]) == 0
    made = json.loads(capsys.readouterr().out)
    assert made["provenance"]["files"][0]["name"] == "run.csv" and made["coherence"]


def test_the_picture_of_gains_shows_their_loop(folder, capsys):
    assert main([*BODE, "--tune", "PI", "--plot", "tuned.png", "--json"]) == 0
    said = capsys.readouterr()
    made = json.loads(said.out)
    assert "picture: tuned.png" in said.err and (folder / "tuned.png").stat().st_size > 10_000
    assert made["frequency"] and made["gains"]["kp"] > 0 and made["gains"]["Ms"] < 1.61
    found = lg.frequency_response(folder / "run.csv", folder / "my.toml")
    gains = lg.tune(found, "PI")
    axes = replace(found, gains=gains).plot()
    assert [ax.get_xlabel() for ax in axes][-2:] == ["Re L", "t [s]"] and len(axes) == 5
    assert f"kp {gains.kp:.4g}" in axes[3].get_title(loc="left")
    plt.close(axes[0].figure)


def test_the_command_tunes_a_model_and_refuses_what_is_out_of_reach(folder, capsys):
    lg.write_model(lg.Model.of(J=0.002, friction="viscous", Fv=0.02), "known.toml")
    tuned = ["bode", "--model", "known.toml", "--tune", "PI"]
    assert main([*tuned, "--dead-time", "1e-3"]) == 0
    assert "PI gains: bandwidth" in capsys.readouterr().out
    assert main([*tuned, "--rate", "1000", "--bandwidth", "5", "--json"]) == 0
    made = json.loads(capsys.readouterr().out)
    assert made["bandwidth"] == pytest.approx(10 * np.pi, rel=1e-3)
    assert main([*tuned, "--rate", "1000", "--bandwidth", "4000"]) == 3
    assert "at most" in capsys.readouterr().err
    assert main([*BODE, "--tune", "P-PI", "--ms", "1.0001", "--json"]) == 3
    said = capsys.readouterr()
    assert json.loads(said.out)["gains"] is None and "no gains" in said.err
    assert main(["bode", "--model", "known.toml"]) == 2
    assert main([*BODE, "--ms", "2"]) == 2
    assert "--tune" in capsys.readouterr().err


def test_the_command_refuses_with_a_code_of_its_own(folder, capsys):
    assert main(["bode", "short.csv", "--model", "my.toml", "--json"]) == 3
    said = capsys.readouterr()
    assert json.loads(said.out)["frequency"] == [] and "longest stretch" in said.err
    assert main([*BODE, "--out", "bode.txt"]) == 2
    assert "picture must be a file" in capsys.readouterr().err
