"""A model in the place of a log, and a log in that of the model: one sentence, in every form."""

import re

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.record import read_log

T = 1e-3 * np.arange(400)
COLUMNS = {"t": T, "u": np.sin(9 * T), "w": np.sin(7 * T)}
LOGS = {
    "dict": COLUMNS,
    "lists": {k: x.tolist() for k, x in COLUMNS.items()},
    "record": lg.read_record(COLUMNS),
    "log": read_log(COLUMNS),
    "array": np.c_[*COLUMNS.values()],
    "several": [COLUMNS, COLUMNS],
    "file": "run.csv",
}
MODELS = {
    "model": lg.Model.of(J=0.002),
    "parameters": lg.table1(),
    "dict": {"J": 0.002, "friction": "coulomb"},
    "tables": {"plant": {"J": 0.002}, "effects": ["gravity"]},
    "file": "my.toml",
}


@pytest.mark.parametrize("log", LOGS)
@pytest.mark.parametrize("model", MODELS)
def test_a_swapped_pair_is_one_sentence(model, log):
    first = "my.toml" if model == "file" else "record"
    second = "run.csv" if log == "file" else "model"
    said = re.escape(f"{first} is a model and {second} is a log: swap them.")
    with pytest.raises(lg.InputError, match=f"^{said}$"):
        lg.diagnose(MODELS[model], LOGS[log])


@pytest.mark.parametrize(
    "work", [lg.identify, lg.balance, lg.compare_laws, lg.diagnose_each], ids=lambda w: w.__name__
)
def test_every_function_of_a_log_and_a_model_says_so(work):
    with pytest.raises(lg.InputError, match="record is a model and model is a log: swap them"):
        work(MODELS["model"], LOGS["record"])


@pytest.mark.parametrize("pair", [("model", "model"), ("dict", "parameters")])
def test_two_models_are_not_swapped(pair):
    one, other = (MODELS[name] for name in pair)
    with pytest.raises(lg.InputError) as no:
        lg.diagnose(one, other)
    assert "swap" not in str(no.value)
