"""What users pass in: every form of a record and a model, and one sentence for what is neither."""

from dataclasses import fields, replace
from pathlib import Path

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.model import as_model
from lugrectl.core.errors import InputError
from lugrectl.diagnosis.asked import Asked

P = lg.table1()
MODEL = lg.Model.of(P)
LOOP = lg.velocity_loop(P)
T = np.arange(0, 0.02, 1e-3)
LONG = np.arange(4000) * 1e-3
COLUMNS = {
    "t": LONG,
    "u": 0.1 * np.cos(3 * LONG) + 0.3 * np.sign(np.cos(3 * LONG)),
    "theta": np.sin(3 * LONG),
}
RECORD = lg.read_record(COLUMNS)
TABLE = {"plant.Fc": [0.2, 0.3]}


def simulate(*args, **kw):
    return lg.simulate(LOOP, *args, **kw)


# the call, and words of the sentence: the argument that is named first of all
WRONG = [
    (lambda: lg.diagnose(None, MODEL), "record must be"),
    (lambda: lg.diagnose([], MODEL), "record is an empty list"),
    (lambda: lg.diagnose([RECORD, 3], MODEL), "each record must be"),
    (lambda: lg.diagnose("no.csv", MODEL), "no.csv: no such file"),
    (lambda: lg.diagnose(RECORD, 3), "model must be"),
    (lambda: lg.diagnose(RECORD, "no.toml"), "no.toml: no such model file"),
    (lambda: lg.diagnose(RECORD, MODEL, horizon=-1), "horizon must be"),
    (lambda: lg.diagnose(RECORD, MODEL, seed="x"), "seed must be"),
    (lambda: lg.diagnose(RECORD, MODEL, holdout=0.3), "holdout must be"),
    (lambda: lg.diagnose(RECORD, MODEL, holdout=COLUMNS), "holdout holds the same samples"),
    (lambda: lg.diagnose_each("no-such-folder", MODEL), "no-such-folder: no such file or folder"),
    (lambda: lg.diagnose_each(3, MODEL), "records must be"),
    (lambda: lg.diagnose_each([3], MODEL), "each log must be"),
    (lambda: lg.diagnose_each([RECORD], MODEL, executor=3), "executor must be"),
    (lambda: lg.read_record(3), "record must be"),
    (lambda: lg.read_record(np.ones((4, 3))), "record must be"),
    (lambda: lg.read_record("x" * 5000), "cannot be read"),
    (lambda: lg.read_record({}), "has no columns"),
    (lambda: lg.read_record(COLUMNS, columns=["t", "u"]), "columns must be a dict"),
    (lambda: lg.read_record(COLUMNS, rate="1k"), "rate must be"),
    (lambda: lg.read_record(RECORD, rate=3), "rate is for a log that is still to be read"),
    (lambda: lg.read_record({**COLUMNS, "u": 1j * LONG}), "column 'u' must be real"),
    (lambda: lg.read_record({**COLUMNS, "u": ["a"] * 4000}), "'u' holds 'a' at sample 1"),
    (lambda: lg.read_record({**COLUMNS, "u": LONG[1:]}), "differ in length .*u 3999"),
    (lambda: lg.read_record({**COLUMNS, "u": 3}), "'u' must hold one number for each sample"),
    (lambda: lg.Record(t=LONG, u="x", w=LONG), "u must be real numbers"),
    (lambda: lg.Model.of(None), "model must be"),
    (lambda: lg.Model.of(Fd=1), "unknown key 'Fd'"),
    (lambda: lg.Model.of(effects=3), "effects must be"),
    (lambda: MODEL.with_effect("typo"), "no effect named 'typo'"),
    (lambda: lg.Parameters(J=1), "sigma0, sigma1, Fc, Fs, Fv, vs missing"),
    (lambda: lg.plant(P, inputs=3), "inputs must be"),
    (lambda: lg.plant(P, name="a.b"), "name must be"),
    (lambda: lg.sensor(3), "model must be"),
    (lambda: lg.effect("typo"), "no effect named 'typo'"),
    (lambda: lg.effect("gravity", amplitude="x"), "amplitude must be a number"),
    (lambda: lg.friction("lugre", sigma0=0), "sigma0 = 0 must be above 0"),
    (lambda: lg.pi("a"), "pi.kp must be a number"),
    (lambda: lg.feedforward(3), "p must be"),
    (lambda: lg.tabulated("theta", "ab", "cd"), "points must be real numbers"),
    (lambda: lg.deflection("x", 1e-3, P), "w must be real numbers"),
    (lambda: lg.sampled(3, 1e-3), "system must be"),
    (lambda: lg.block("observer", out=3), "out must be a name or a list of names"),
    (lambda: lg.block("effect", out="d")(3), "declared of a function"),
    (lambda: lg.velocity_loop(P, "x"), "no observer named 'x'"),
    (
        lambda: lg.velocity_loop(P, "natural", K1=10, k=3),
        "K1 is no argument of the loop",
    ),
    (lambda: lg.velocity_loop(P, "proposed", K1=None, K2=None), "K1 = None is no gain"),
    (lambda: lg.velocity_loop(P, observer_parameters=3), "observer_parameters must be"),
    (lambda: lg.compensate(3), "model must be"),
    (lambda: lg.compensate(P, loop=["velocity"]), "unknown loop"),
    (lambda: lg.compensate(P, kp="x"), "kp must be"),
    (lambda: lg.compensate(P, record=3), "record must be"),
    (lambda: lg.compensate(P, reference=("a", "b")), "reference: t must be"),
    (lambda: lg.simulate(None, T, 0.1), "system must be"),
    (lambda: lg.simulate(ct.tf([1, 0], [1]), T), "no state-space form"),
    (lambda: lg.simulate([lg.plant(P), 3], T), "a block must be"),
    (lambda: simulate(T, timepts=T), "t or timepts"),
    (lambda: simulate(T, "sin"), "inputs must be"),
    (lambda: simulate(T, 1j * T), "inputs must be .*complex"),
    (lambda: simulate(T, {"r": "x"}), "input r must be"),
    (lambda: simulate(T, 0.1, [0.0, np.eye(2)]), "has 4 states, x0 has 5"),
    (lambda: simulate(T, 0.1, "zero"), "x0 must be"),
    (lambda: simulate(T, 0.1, rtol=-1), "rtol must be"),
    (lambda: simulate(T, 0.1, method="RK99"), "method must be"),
    (lambda: simulate(T, 0.1, hold="zoh"), "hold must be"),
    (lambda: simulate(T, 0.1, params={"plant.Fc": "high"}), "plant.Fc must be a number"),
    (lambda: simulate(T, 0.1, params={"plant.J": -1.0}), "plant.J = -1 must be above 0"),
    (lambda: lg.simulate_sampled(lg.plant(P), T, 0.1), "drive must be"),
    (lambda: lg.simulate_sampled(None, [], T), "plant must be"),
    (lambda: lg.sweep(None, T, 0.1, TABLE), "system must be"),
    (lambda: lg.sweep(LOOP, T, 0.1, TABLE, reduce="max"), "reduce must be"),
    (lambda: lg.l2_check(P), "needs K2"),
    (lambda: lg.spr_check("x"), "T is 'x'"),
    (lambda: lg.spr_check(([1, 1j], [1, 1])), "a coefficient of the numerator is 1j"),
    (lambda: lg.position_T(P, kp="x"), "kp is 'x'"),
    (lambda: lg.certify(P, np.complex128(1), 22), "K1 must be a number"),
    (lambda: lg.design_gains(P, ["constant"]), "unknown method"),
]


@pytest.mark.parametrize(("call", "words"), WRONG, ids=range(len(WRONG)))
def test_a_wrong_argument_is_one_sentence_that_names_it(call, words):
    with pytest.raises(InputError, match=words) as said:
        call()
    assert "\n" not in str(said.value)


# ---- records ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("run") / "run.csv"
    rows = np.column_stack(list(COLUMNS.values()))
    np.savetxt(path, rows, delimiter=",", header="t,u,theta", comments="", fmt="%.17g")
    return path


def same(one, other):
    pairs = zip(one.channels().items(), other.channels().items(), strict=True)
    return all(a == b and np.allclose(x, y, rtol=1e-9, atol=1e-9) for (a, x), (b, y) in pairs)


def frames():
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame(COLUMNS)
    rest = frame.drop(columns="t")
    stamps = pd.Timestamp("2024-05-01 12:00") + pd.to_timedelta(LONG, unit="s")
    whole = frame.assign(u=frame["u"].astype("Float64"), theta=np.rad2deg(COLUMNS["theta"]))
    return {
        "plain": frame,
        "index named t": frame.set_index("t"),
        "index named time [ms]": rest.set_index(pd.Index(1e3 * LONG, name="time [ms]")),
        "instants": rest.set_index(stamps),
        "instants with a name": rest.set_index(stamps.rename("stamp")),
        "instants with a zone": rest.set_index(stamps.tz_localize("Europe/Berlin")),
        "a column of instants": rest.assign(time=stamps),
        "durations": rest.set_index(pd.to_timedelta(LONG, unit="s")),
        "an index beside t": frame.set_index(pd.Index(np.arange(4000.0) ** 2, name="time")),
        "units and missing values": whole.rename(columns={"theta": "theta [deg]"}),
    }


def test_a_data_frame_is_read_as_a_file_of_its_columns():
    for form, frame in frames().items():
        assert same(lg.read_record(frame), RECORD), form


def test_the_options_of_reading_hold_for_tables_in_memory():
    renamed = {"clock": 1e3 * LONG, "i": COLUMNS["u"] / 0.5, "speed [rpm]": LONG % 1.0}
    renamed["pos"] = np.rad2deg(COLUMNS["theta"])
    options = {"columns": {"t": "clock", "u": "i", "theta": "pos"}, "scale": {"u": 0.5}}
    made = lg.read_record(renamed, units={"t": "ms", "theta": "deg"}, **options)
    assert np.allclose(made.u, RECORD.u) and np.allclose(made.theta, RECORD.theta)
    without = {k: v for k, v in COLUMNS.items() if k != "t"}
    assert same(lg.read_record(without, rate=1000), RECORD)
    turning = lg.read_record({**COLUMNS, "theta": None, "w [rpm]": 30 * np.cos(3 * LONG)})
    assert turning.w is not None and np.isclose(np.abs(turning.w).max(), np.pi)


def test_other_tables_in_memory_are_read_too(tmp_path):
    rows = np.array(list(zip(*COLUMNS.values(), strict=True)), dtype=[(k, float) for k in COLUMNS])
    lists = {k: v.tolist() for k, v in COLUMNS.items()}
    lists["theta"][7] = None
    np.savez(tmp_path / "run.npz", **COLUMNS)
    with np.load(tmp_path / "run.npz") as archive:
        assert same(lg.read_record(archive), RECORD)
    assert same(lg.read_record(rows), RECORD)
    assert same(
        lg.read_record({"axis": COLUMNS}, columns={k: f"axis.{k}" for k in COLUMNS}), RECORD
    )
    filled = lg.read_record(lists)
    assert filled.dropped == 1 and np.allclose(filled.theta, RECORD.theta, atol=1e-6)
    masked = np.ma.masked_array(COLUMNS["theta"], mask=LONG == LONG[7])
    assert lg.read_record({**COLUMNS, "theta": masked}).dropped == 1
    assert lg.read_record(RECORD) is RECORD


def test_a_record_is_taken_in_every_form(run):
    for given in (run, str(run), COLUMNS, RECORD):
        asked = Asked.of(given, MODEL)
        assert same(asked.records()[0], RECORD) and asked.model is MODEL and asked.holdout() is None
    asked = Asked.of([str(run), COLUMNS], MODEL, {**COLUMNS, "u": -COLUMNS["u"]})
    assert len(asked.records()) == 2 and isinstance(asked.holdout(), lg.Record)
    assert Asked.of(run, MODEL, "last").holdout() == "last"


def test_records_are_read_for_the_motion_of_the_model():
    linear = lg.Model.of(J=2.0, motion="linear")
    assert Asked.of(COLUMNS, linear).records()[0].motion == "linear"
    with pytest.raises(
        InputError, match="w is in rpm, but motion is 'linear'.*whose model has motion"
    ):
        Asked.of({**COLUMNS, "w [rpm]": COLUMNS["theta"]}, linear)


@pytest.mark.slow
def test_a_fleet_takes_tables_and_models_of_every_form(run):
    short = {k: v[:50] for k, v in COLUMNS.items()}
    fleet = lg.diagnose_each([run.with_name("none.csv"), short, dict(short)], {"J": 0.002})
    assert [o.file for o in fleet.outcomes][1:] == ["the dict of arrays", "the dict of arrays (2)"]
    assert [o.verdict for o in fleet.outcomes] == ["failed", "refused", "refused"]


# ---- models -------------------------------------------------------------------------


def test_a_model_is_made_of_values_by_name():
    model = lg.Model.of(J=0.002, Fc=0.3)
    assert model.friction.block.name == "lugre" and model.known() == {"J": 0.002, "Fc": 0.3}
    other = lg.Model.of(friction="coulomb", effects=["gravity", {"name": "backlash", "gap": 0.1}])
    assert other.J is None and other.part("backlash").values["gap"] == 0.1
    assert [part.key for part in other.effects] == ["gravity", "backlash"]
    assert lg.Model.of() == lg.Model.of({})
    assert lg.Model.of(J=1.0, name="axis", motion="linear").unit("J") == "kg"


def test_a_model_is_made_of_another_with_changes():
    assert lg.Model.of(P) == MODEL
    changed = lg.Model.of(P, Fc=0.2, effects="gravity")
    assert changed.values()["Fc"] == 0.2 and changed.part("gravity").values["amplitude"] is None
    assert lg.Model.of(P, friction="viscous").known() == {"J": P.J, "Fv": P.Fv}
    assert lg.Model.of(changed, effects=[]) == lg.Model.of(changed) == changed


def test_a_model_is_taken_in_every_form(tmp_path):
    lg.write_model(MODEL, tmp_path / "m.toml")
    nested, flat = MODEL.to_dict(), {f.name: getattr(P, f.name) for f in fields(P)}
    for given in (tmp_path / "m.toml", str(tmp_path / "m.toml"), nested, P, MODEL):
        assert replace(as_model(given), name=MODEL.name) == MODEL
    assert as_model(flat).known() == MODEL.known()
    assert lg.plant(tmp_path / "m.toml").params == lg.plant(P).params
    assert lg.velocity_loop(flat, "natural").syslist[0].params == lg.plant(P).params
    assert lg.l2_check(MODEL, 22).gain == lg.l2_check(P, 22).gain
    assert lg.certify(str(tmp_path / "m.toml"), -1, 22).rate == lg.certify(P, -1, 22).rate
    assert np.array_equal(lg.position_T(nested, kp=1).den[0][0], lg.position_T(P, kp=1).den[0][0])


# ---- systems ------------------------------------------------------------------------


def test_an_array_without_names_is_told_how_to_name_its_columns():
    with pytest.raises(InputError, match=r"record is an array without names.*dict of arrays"):
        lg.diagnose(np.zeros((100, 3)), MODEL)


@pytest.mark.parametrize(
    ("known", "words"),
    [
        ({"J": 1.0, "Fc": 1.0}, "Fv has no value; identify it first"),
        ({"J": 1.0}, "Fc, Fv have no values; identify them first"),
    ],
)
def test_values_that_are_missing_are_counted(known, words):
    with pytest.raises(InputError, match=words):
        lg.plant(lg.Model.of(friction="coulomb", **known))
