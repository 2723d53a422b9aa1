"""What results hand out: a table of parameters, dict, JSON, pandas, files. They pickle."""

import importlib
import json
import pickle
from dataclasses import replace

import numpy as np
import pytest

import lugrectl as lg
from lugrectl import report
from lugrectl.blocks.block import REGISTRY
from lugrectl.core.errors import InputError
from lugrectl.diagnosis.fleet import Outcome
from lugrectl.estimates.findings import Candidate, Finding

from ..cases.made_up import bare, diagnosis
from ..cases.shown_results import friction_map, identification, table
from ..cases.small_answers import answer

P = lg.table1()
T = np.linspace(0.0, 1.0, 101)


def fleet():
    d, no = bare(), bare("refused")
    outcomes = [Outcome(f, document=x.summary(), diagnosis=x) for f, x in (("a", d), ("b", no))]
    return lg.Fleet((*outcomes, Outcome("c", 2, reason="no such file.")), model=d.model)


# --- the table of parameters --------------------------------------------------------------


def parameters():
    return answer("identified").parameters


def test_rows_are_found_by_number_and_by_name():
    rows = parameters()
    assert rows.names == ("J", "Fc", "Fv") and "J" in rows and "K" not in rows
    J = rows["J"]
    assert rows[0] == J == ("J", J.value, J.low, J.high, "kg m2", None)
    assert [row.name for row in rows] == list(rows.names) and rows[0:1] == (J,)
    with pytest.raises(InputError, match="no fitted parameter 'Fs'; there is J, Fc, Fv"):
        rows["Fs"]


# --- forms -------------------------------------------------------------------------------


@pytest.mark.parametrize("make", [diagnosis, identification, table, friction_map, fleet])
def test_dict_json_and_summary_agree(make):
    result = make()
    assert result.to_dict() == result.summary() == json.loads(result.to_json())


def test_every_result_becomes_a_frame():
    pytest.importorskip("pandas")
    assert list(diagnosis().to_frame().index) == list(identification().to_frame().index) == ["J"]
    assert list(table().to_frame()) == ["theta", "torque", "standard_error"]
    both = table([[0.1, 0.2, 0.3], [0.2, 0.3, 0.4]])
    assert list(both.to_frame()["torque, w < 0"]) == [0.2, 0.3, 0.4]
    assert list(friction_map().to_frame()["held_out"]) == [True, False, False, True]
    rows = fleet().to_frame()
    assert list(rows["verdict"]) == ["found", "refused", "failed"]
    assert rows.loc[0, "effects"] == "torque_ripple"
    assert parameters().to_frame().loc["J", "high"] == parameters()["J"].high


def test_simulated_loops_become_a_frame_over_loop_and_time():
    pytest.importorskip("pandas")
    c = lg.compensate(lg.Model.of(P), reference=(T, np.sin(4.0 * T)))
    frame = c.to_frame()
    assert frame.index.names == ["loop", "t"] and list(frame) == ["r", "y", "u"]
    error = frame.loc["none", "y"] - frame.loc["none", "r"]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(c.none)


def test_without_pandas_one_sentence_says_what_to_install(monkeypatch):
    real = importlib.import_module

    def missing(name, *rest):
        if name == "pandas":
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr("lugrectl.core.result.import_module", missing)
    for result in (diagnosis(), table(), friction_map(), fleet()):
        with pytest.raises(InputError, match="pandas is not installed; python -m pip install"):
            result.to_frame()


# --- files -------------------------------------------------------------------------------


def test_save_of_a_fleet_writes_index_table_and_reports(tmp_path):
    index, rows = fleet().save(tmp_path)
    assert 'href="a/report.html"' in index.read_text() and "c,failed" in rows.read_text()
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == sorted(report.FILES)
    assert not (tmp_path / "b" / "model.toml").exists() and not (tmp_path / "c").exists()


# --- pickling ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "make",
    [
        diagnosis,
        identification,
        table,
        friction_map,
        fleet,
        parameters,
        lambda: diagnosis().record,
        lambda: diagnosis().model,
        lambda: P,
        lambda: lg.certify(P, -10.24, 22.0),
        lambda: lg.design_gains(P, "time-varying"),
        lambda: lg.l2_check(P, K2=22.0),
        lambda: lg.spr_check(lg.position_T(P, kp=15.0)),
        lambda: lg.bandwidth_check(lg.velocity_loop_tf(P, kp=1.6, ki=0.16)),
        lambda: lg.check_designs(P, kp=T, K2=22.0),
        lambda: lg.excitation(np.sin(6.3 * T), T),
        lambda: lg.sweep(lg.pi(1.6, 0.16), T, np.sin(T), {"pi.kp": [1.0, 2.0]}),
    ],
)
def test_results_pickle(make):
    thing = make()
    again = pickle.loads(pickle.dumps(thing))
    assert type(again) is type(thing) and repr(again) == repr(thing)
    if hasattr(thing, "summary"):
        assert again.summary() == thing.summary()


def test_what_distinguishes_an_effect_without_an_experiment_is_that_of_its_rival(monkeypatch):
    one = Finding("gravity", {}, (Candidate("hard_stop", 1.0, 0.1),))
    silent = replace(REGISTRY["effect", "gravity"], experiment="")
    monkeypatch.setitem(REGISTRY, ("effect", "gravity"), silent)
    assert one.apart().endswith(REGISTRY["effect", "hard_stop"].experiment)
    alone = Finding("gravity", {}, (Candidate("unknown(theta)", 1.0, 0.1),))
    assert "record a run with other speeds" in alone.apart()
