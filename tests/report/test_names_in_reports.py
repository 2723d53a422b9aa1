"""Names of files, columns, effects and models do nothing in a report, whatever they hold."""

from dataclasses import replace

import numpy as np
import pytest

import lugrectl as lg
from lugrectl import report
from lugrectl.diagnosis.fleet import Fleet
from lugrectl.estimates.findings import Candidate, Estimate, Finding
from lugrectl.report import diagnosis_plots, fleet_page

from ..cases.html_page import safe
from ..cases.made_up import diagnosis
from ..fuzz.files import motion

ACT = "document.title='ran'"
NAMES = {
    "script": f"<script>{ACT}</script>",
    "image": f'"><img src=x onerror="{ACT}">',
    "style": "</style></title></svg><svg onload=" + ACT + ">",
    "comment": "--><!-- ]]> &lt;b&gt;",
    "attribute": f"' onmouseover='{ACT}",
    "math": r"$\frac{1}{$ a_{b}$ \notthere $",
    "control": "a\x00b\x0b\x1b[31m\u202e\ud7ff",
}


def named(name):
    """A diagnosis in which everything that a user names has this name."""

    def own(theta, amplitude=lg.P(0.0, f"N m {name}", 0.0, neutral=0.0)):
        return amplitude * np.sin(theta)

    own.__doc__ = f"r_e = {name}"
    lg.block("effect", out="d", acts="torque", name=name, confused=name, experiment=name)(own)
    d = diagnosis()
    model = replace(d.model, name=name).with_effect(name, {"amplitude": 0.1})
    found = Finding(name, {"amplitude": Estimate(0.1, f"N m {name}", (0.0, 1.0))},
                    (Candidate(name, 3.0, 0.1),))  # fmt: skip
    return replace(
        d,
        effects=(found,),
        model=model,
        declared=model,
        depends_on=(name,),
        experiment=name,
        messages=(f"{name}, line 3: {name}",),
        ranking=(Candidate(name, 3.0, 0.1), *d.ranking),
        record=replace(d.record, source=name),
    )


@pytest.mark.slow
@pytest.mark.cases
@pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)
def test_a_name_is_text_in_the_report_and_in_its_pictures(name):
    d = named(name)
    said = "".join(safe(report.html(d)).said)
    if "\x00" not in name:
        assert name in said
    assert d._repr_html_() and diagnosis_plots.figures(d)


@pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)
def test_a_name_is_text_in_the_table_of_many_logs(name):
    fleet = Fleet((), unfinished=(name,), model=replace(lg.Model.of(lg.table1()), name=name))
    safe(fleet_page.page(fleet).fragment())
    safe(lg.Model.of(fleet.model)._repr_html_())


@pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)
def test_a_column_or_file_of_any_name_is_read_and_shown(name, tmp_path):
    log = {k: v[:300] for k, v in motion().items()}
    log[name] = log.pop("theta")
    try:
        record = lg.read_record(log, columns={"theta": name})
    except lg.InputError as error:  # a comma or a sign of equality in a list of columns
        assert "\n" not in str(error)
        return
    safe(replace(record, source=name)._repr_html_())
