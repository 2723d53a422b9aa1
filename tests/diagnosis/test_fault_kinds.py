"""A log with one fault is answered as the sound log is, and the fault is said with its place."""

import json

import numpy as np
import pytest

from lugrectl import InputError, Refused, balance, identify, read_record
from lugrectl.cli import main
from lugrectl.record.files.text import with_remark

from ..cases.balance_drive import FC, FV, J
from ..cases.faulty_logs import COUNT, columns, late, put, with_w, write

TRUE = {"J": J, "Fc": FC, "Fv": FV}


def held(every, *roles):
    """Values renewed every few rows only."""

    def change(log):
        rows = np.arange(len(log["t"])) // every * every
        return {k: x[rows] if k in roles else x for k, x in log.items()}

    return change


def frozen(log):
    log["theta"][1800:1900] = log["theta"][1800]
    return log


def pasted(log):
    log["theta"][2750:] += 1.9
    return log


def counter(bits):
    """theta in counts of a register of so many bits."""

    def change(log):
        log["theta"] = np.rint(log["theta"] / COUNT) % 2**bits
        return log

    return change


def wrapped(log):
    """u in steps of 1/250 N m in 8 bits with sign."""
    log["u"] = ((np.rint(log["u"] * 250) + 128) % 256 - 128) / 250
    return log


def register(log):
    log["u"] = np.clip(log["u"], -0.42, 0.42)
    return log


KINDS = {
    "a torque far off": (put("u", 3021, 5.0), "u at line 3023 is 5 N m"),
    "a row without a time": (put("t", 1998, 0.0), "t at line 2000 is 0 s"),
    "a position that stands still": (frozen, "theta stands at"),
    "all renewed every third row": (held(3, "u", "theta"), "renewed only every 6 ms"),
    "a torque reported late": (late(7), None),
    "two runs pasted together": (pasted, "at line 2752, which is no motion"),
    "a torque register that wraps": (wrapped, "u wraps by 1.024 N m"),
    "a torque register at its end": (register, "u stands at -0.42 N m in"),
    "a late speed": (with_w(lambda w: np.r_[w[:1].repeat(4), w[:-4]]), None),
}


def slow(kind):
    return pytest.param(kind, marks=pytest.mark.slow)


def holds(plain, within=0.02):
    """The values are right, and the truth is within the intervals or next to them."""
    for key, true in TRUE.items():
        found = plain.parameters[key]
        low, high = found.ci95
        assert found.value == pytest.approx(true, rel=within), key
        assert low - (high - low) <= true <= high + (high - low), key


def said(plain, words):
    """One sentence and no more says so."""
    said = (*plain.reading, *plain.notes)
    assert len([note for note in said if words in note]) == 1, said


def test_the_sound_log_is_answered_without_a_note(tmp_path):
    plain = balance(write(tmp_path, columns()), {})
    holds(plain, within=0.01)
    assert (*plain.reading, *plain.notes) == ()


@pytest.mark.parametrize("kind", [k if KINDS[k][1] else slow(k) for k in KINDS])
def test_a_log_with_one_fault_is_answered_and_the_fault_is_said(tmp_path, kind):
    change, words = KINDS[kind]
    plain = balance(write(tmp_path, change(columns())), {})
    holds(plain, within=0.03)
    if words:
        said(plain, words)


@pytest.mark.cases
@pytest.mark.parametrize("bits", [12, 16])
def test_a_counter_that_wraps_needs_its_factor_only(tmp_path, bits):
    from lugrectl.record import read_log

    path = write(tmp_path, counter(bits)(columns()))
    holds(balance(read_log(path, scale={"theta": COUNT}), {}))


def test_short_runs_are_one_data_set(tmp_path):
    parts = [slice(k, k + 850) for k in range(0, 2550, 850)]
    paths = [
        write(tmp_path, {k: x[part] for k, x in columns().items()}, f"run{i}.csv")
        for i, part in enumerate(parts)
    ]
    holds(balance(paths, {}))


def test_a_note_on_one_of_several_logs_names_it(tmp_path):
    paths = [
        write(tmp_path, columns(seconds=5.0), "first.csv"),
        write(tmp_path, put("u", 901, -4.0)(columns(seconds=5.0, seed=5)), "second.csv"),
    ]
    plain = balance(paths, {})
    holds(plain)
    said(plain, "second.csv: u at line 903 is -4 N m")


# What is noticed is said once, truly, and names what was left out.


def test_no_sentence_of_the_json_comes_twice(tmp_path, capsys):
    path = write(tmp_path, with_w(lambda w: np.r_[w[:1].repeat(4), w[:-4]])(columns()))
    (tmp_path / "m.toml").write_text('name = "drive"\n[plant]\n[friction]\nmodel = "coulomb"\n')
    main(["identify", str(path), "--model", str(tmp_path / "m.toml"), "--json"])
    messages = json.loads(capsys.readouterr().out)["messages"]
    assert len(set(messages)) == len(messages)
    assert sum("behind dtheta/dt" in m or "lags theta" in m for m in messages) == 1
    assert not any("steps of the sensor" in m for m in messages)


def test_a_log_that_shows_its_sensors_only_is_refused():
    """Noise in place of the torque: how late the speed is says nothing of the drive."""
    log = columns("w", seconds=5.0)
    log["u"] = 0.3 * np.random.default_rng(1).standard_normal(len(log["t"]))
    with pytest.raises(Refused) as no:
        identify(log, {})
    assert no.value.plain is not None and "J" not in no.value.plain.parameters


@pytest.mark.parametrize("cell", ["-1200,,was -8.9", "3.5 (typed)", "0; see note", "1e3 error"])
def test_a_number_with_words_beside_it_was_typed_over(cell):
    assert with_remark(cell)


@pytest.mark.parametrize("cell", ["abc", "1.2.3", "12_3", "3.5", "1,000", "2024-03-09"])
def test_other_cells_were_not(cell):
    assert not with_remark(cell)


def test_other_text_in_a_cell_is_an_error(tmp_path):
    log = columns()
    path = write(tmp_path, log | {"u": ["12_3", *(f"{x:.9g}" for x in log["u"][1:])]})
    with pytest.raises(InputError, match="line 2, column 'u': '12_3' is not a number"):
        read_record(path)
