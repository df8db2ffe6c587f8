# Copyright 2026 cpg_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The reproduction report: as an executable, its rows, and what makes it fail."""

import base64
from dataclasses import replace
from functools import partial
import json
from pathlib import Path
import re
import subprocess
import sys

from cpg_ros.analysis.papers import (
    buono_gaits,
    buono_hopf,
    liu_zhang,
    rashidi,
    reproduce,
)
from cpg_ros.analysis.papers.reproduce import ERRATA, PAPERS
from cpg_ros.analysis.papers.row import Citation
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.hopf import first_hopf
from cpg_ros.networks.symmetry import Z4_Z2
import numpy as np
import pytest

AT = Citation('Somebody 2000', 'Table 1')
KEYS = {'paper': str, 'place': str, 'quantity': str, 'published': str, 'computed': str,
        'agrees': bool, 'compared': str, 'verdict': str, 'note': str, 'corrected': str,
        'explained': bool}


@pytest.fixture(scope='module')
def report(tmp_path_factory):
    """One run of the executable on all papers: process, JSON, page."""
    out = tmp_path_factory.mktemp('reproduce') / 'deep'
    process = subprocess.run(
        [sys.executable, '-P', '-W', 'error::RuntimeWarning', '-m',
         'cpg_ros.analysis.papers.reproduce',
         '--json', out / 'rows.json', '--html', out / 'page.html'], text=True, capture_output=True)
    assert process.returncode == 0, process.stdout[-3000:] + process.stderr
    assert sorted(file.name for file in out.iterdir()) == ['page.html', 'rows.json']
    return process, json.loads((out / 'rows.json').read_text()), (out / 'page.html').read_text()


def only(monkeypatch, name, *sections):
    """Let a paper consist of some sections, and be the only one."""
    paper = PAPERS[name]
    monkeypatch.setattr('cpg_ros.analysis.papers.reproduce.PAPERS',
                        {name: replace(paper, sections=sections or paper.sections)})


def outcome(capsys, name):
    """Exit code, and rows as JSON."""
    code = reproduce.main(['--paper', name, '--jobs', '1', '--json', '-'])
    return code, json.loads(capsys.readouterr().out)['rows']


def test_all_papers_are_covered_and_nothing_fails(report):
    _, tree, _ = report
    rows = tree['rows']
    assert len(rows) >= 450
    assert {row['paper'] for row in rows} == {paper['authors'] for paper in tree['papers']}
    summary = tree['summary']
    assert summary['published'] == len(rows) and summary['failed'] == 0
    assert summary['agree'] == sum(row['verdict'] == 'agrees' for row in rows)
    assert summary['agree'] + summary['explained'] == len(rows)
    places = {(row['paper'][:3], row['place']) for row in rows}
    wanted = {('Liu', f'Table {n}') for n in (1, 2)} | {('Liu', f'Figure {n}') for n in (
        2, 3, 4, 7, 10)} | {('Liu', 'Example 1'), ('Liu', 'Example 2'), ('Liu', 'section 4.1'),
                            ('Liu', 'section 4.2')}
    wanted |= {('Buo', f'Table {n}') for n in range(1, 14)} | {('Buo', 'Figure 2')}
    wanted |= {('Ras', f'Table {n}') for n in range(1, 6)} | {
        ('Ras', f'Figure {n}') for n in (2, 8, 9, 10, 11)}
    assert wanted <= places


def test_json_has_a_schema(report):
    _, tree, _ = report
    assert set(tree) == {'papers', 'summary', 'rows', 'errata'}
    for row in tree['rows']:
        assert set(row) == {*KEYS, 'value', 'erratum'}
        assert all(type(row[key]) is kind for key, kind in KEYS.items()), row
        assert row['value'] is None or isinstance(row['value'], float | int)
        expected = 'agrees' if row['agrees'] else f'erratum {row["erratum"]}'
        assert row['verdict'] == expected


def test_errata_are_numbered_used_and_of_the_right_paper(report):
    _, tree, _ = report
    assert list(ERRATA) == list(range(1, len(ERRATA) + 1))
    used = {row['erratum'] for row in tree['rows'] if not row['agrees']}
    # The fifth is about data that were never published.
    assert used == set(ERRATA) - {5}
    for row in tree['rows']:
        if row['erratum'] is not None:
            assert ERRATA[row['erratum']][0] == row['paper'], row


def test_every_erratum_is_in_the_documentation(monkeypatch):
    pytest.importorskip('sphinx', reason='the requirements of the documentation are missing')
    docs = Path(__file__).parents[3] / 'docs'
    monkeypatch.syspath_prepend(docs / 'extensions')
    import generated_tables
    assert '\n```{errata} all\n' in (docs / 'numbers_and_errata.md').read_text()
    listed = re.findall(r'^([0-9]+)\. \*\*.* \*Verified:\* ', generated_tables.errata('all'),
                        re.MULTILINE)
    assert [int(number) for number in listed] == list(ERRATA)


@pytest.mark.parametrize('gait', ['walk', 'bound'])
def test_the_matrix_of_the_genericity_condition_predicts_the_branch(gait):
    """By the implicit function theorem gamma'(alpha) solves it; beside it Hopf points tell."""
    matrix, free = buono_hopf.genericity_matrix(gait), buono_hopf.PROOFS[gait][1]
    x, y = matrix[:2, 2]
    # F, G and E by alpha: in E only the bound has it, as nu - 2 alpha + 2 gamma.
    slope = np.linalg.solve(matrix, -np.array([x, y, {'walk': 0.0, 'bound': -2.0}[gait]]))[2]
    start = buono_hopf._on_line(gait).network
    gammas = []
    for off in (-1e-4, 1e-4):
        alpha = start.alpha + off
        there = start.replace(alpha=alpha, beta=alpha)
        gammas.append(buono_hopf.hopf(there, free, gait, start.gamma - 0.01, start.gamma + 0.01
                                      ).value)
    assert (gammas[1] - gammas[0]) / 2e-4 == pytest.approx(slope, rel=1e-4)


def test_theorem_a1_lets_one_variable_have_no_trot_and_two_have_it():
    """K of the trot is Z4(omega kappa): with one variable Fix(K) is a plane cut by a line."""
    named = Z4_Z2.elements
    every = frozenset(named.values())
    k = buono_gaits.generated(named['omega kappa'])
    assert buono_gaits.of_cells(every, 1).fixed(k).shape == (8, 2)
    assert buono_gaits.of_cells(every, 1).failing(k, every) == ['A.5']
    assert buono_gaits.of_cells(every, 2).failing(k, every) == []


def test_the_page_needs_no_other_file(report):
    _, tree, page = report
    assert not re.search(r'https?:|<script|<link|@import|url\(', page)
    sources = re.findall(r'src="([^"]*)"', page)
    assert len(sources) == 15
    for source in sources:
        kind, _, data = source.partition(',')
        assert kind == 'data:image/png;base64'
        assert base64.b64decode(data).startswith(b'\x89PNG')
    assert page.count('<tr class=') == len(tree['rows'])
    for target in re.findall(r'href="#([^"]*)"', page):
        assert f'id="{target}"' in page


def test_the_table_has_every_row_and_progress_goes_to_standard_error(report):
    process, tree, _ = report
    lines = process.stdout.splitlines()
    ends = [line for line in lines if re.search(r'  (agrees|erratum \d+|FAILS)$', line)]
    assert len(ends) == len(tree['rows'])
    summary = tree['summary']
    assert (f'{summary["published"]} published quantities: {summary["agree"]} agree, '
            f'{summary["explained"]} explained by errata, 0 fail') in lines
    assert all(line.startswith('reproducing [') for line in process.stderr.splitlines())


def test_computed_frequencies_and_delays_solve_the_characteristic_equation(report):
    _, tree, _ = report
    for (place, gait), (a, b, c, d, j) in {
            ('Example 1', 'walk'): (-4.5, 1.0, 6.5, -2.0, 1),
            ('Example 1', 'trot'): (-4.5, 1.0, 6.5, -2.0, 2),
            ('Example 2', 'pace'): (-3.0, 0.1, 4.0, 1.0, 0)}.items():
        omega, tau = (next(row['value'] for row in tree['rows'] if row['place'] == place
                           and row['quantity'].startswith(symbol)
                           and row['quantity'].endswith(f'of the {gait}'))
                      for symbol in ('omega', 'tau'))
        root = 1j * omega
        assert abs(root - a - b - d * 1j**-j + c * np.exp(-root * tau)) < 1e-9


@pytest.mark.parametrize(('printed', 'computed', 'agrees'), [
    ('7.4772', 7.47723, True), ('7.4772', 7.47726, False), ('-0.2349', -0.23494, True),
    ('0.31', 0.305, True), ('0.31', 0.3049, False), ('2', 2, True), ('2', 4, False),
    ('0.5', float('nan'), False)])
def test_numbers_agree_to_the_last_digit_printed(printed, computed, agrees):
    row = AT.number('a number', printed, computed)
    assert row.agrees == agrees
    assert row.verdict == ('agrees' if agrees else 'FAILS')


def test_an_erratum_covers_only_what_it_says():
    erratum = (3, '2.50')
    assert AT.number('a number', '1.00', 2.504, erratum=erratum).verdict == 'erratum 3'
    assert AT.number('a number', '1.00', 2.506, erratum=erratum).verdict == 'FAILS'
    assert AT.number('a number', '1.00', 1.004, erratum=erratum).verdict == 'agrees'
    assert AT.number('a number', '1.00', 2.5, within=0.1, erratum=erratum).verdict == 'erratum 3'
    assert AT.phases('phase', '1/4', [0.75], erratum=(3, '-1/4')).verdict == 'erratum 3'
    assert AT.phases('phase', '1/4', [0.5], erratum=(3, '-1/4')).verdict == 'FAILS'
    assert AT.word('gait', 'walk', 'trot', erratum=(3, 'trot')).verdict == 'erratum 3'
    assert AT.word('gait', 'walk', 'pace', erratum=(3, 'trot')).verdict == 'FAILS'
    assert AT.holds('so it is', False, erratum=3).verdict == 'erratum 3'
    assert AT.formula('a b', 'a b', 6.0, 3.0, erratum=(3, 3.0)).verdict == 'erratum 3'
    assert AT.formula('a b', 'a b', 6.0, 3.1, erratum=(3, 3.0)).verdict == 'FAILS'


def test_phases_agree_modulo_a_cycle():
    assert AT.phases('phases', '0 1/2 -1/4', [0.9999, 0.5001, 0.75]).agrees
    assert not AT.phases('phases', '0 1/2 1/4', [0.0, 0.5, 0.75]).agrees
    assert not AT.phases('phase', '0', [float('nan')]).agrees


def test_words_and_formulas():
    assert AT.holds('so it is', True).agrees and not AT.holds('so it is', False).agrees
    assert AT.word('gait', 'walk', 'walk').agrees and not AT.word('gait', 'walk', 'trot').agrees
    assert AT.formula('a b', 'a b', 6.0, 6.0 + 1e-12).agrees
    assert not AT.formula('a b', 'a b', 6.0, 6.0 + 1e-6).agrees
    assert not AT.formula('a b', 'a b', 6.0, 6.0 + 1e-6j).agrees


def test_a_changed_published_value_fails(monkeypatch, capsys):
    only(monkeypatch, 'rashidi', rashidi.cell)
    code, rows = outcome(capsys, 'rashidi')
    assert code == 0
    monkeypatch.setitem(rashidi.PRINTED['table_1'], 'gCa', '0.8')
    code, changed = outcome(capsys, 'rashidi')
    assert code == 1
    failed = [row for row in changed if row['verdict'] == 'FAILS']
    assert [row['quantity'] for row in failed] == ['gCa']
    # What is computed does not come from what is printed.
    assert [row['computed'] for row in changed] == [row['computed'] for row in rows]


def test_changed_numerics_of_the_delayed_network_fail(monkeypatch, capsys):
    only(monkeypatch, 'liu_zhang', partial(liu_zhang.published_gait, 'trot'))
    monkeypatch.setattr(liu_zhang, 'first_hopf', lambda network, gait: first_hopf(
        replace(network, c=1.01 * network.c), gait))
    code, rows = outcome(capsys, 'liu_zhang')
    failed = {row['quantity'] for row in rows if row['verdict'] == 'FAILS'}
    assert code == 1
    assert {'omega_3 of the trot', 'tau_6^0 of the trot',
            'k1 of the trot, by the printed formula'} <= failed


def test_a_changed_linearisation_fails(monkeypatch, capsys):
    only(monkeypatch, 'buono_golubitsky', buono_hopf.tables)
    assert outcome(capsys, 'buono_golubitsky')[0] == 0
    right = buono_hopf.blocks
    monkeypatch.setattr(buono_hopf, 'blocks', lambda network, state: right(
        replace(network, gamma=-network.gamma), state))
    code, rows = outcome(capsys, 'buono_golubitsky')
    assert code == 1
    assert {'Table 6', 'Table 7', 'Table 8', 'Table 9', 'Table 10'} <= {
        row['place'] for row in rows if row['verdict'] == 'FAILS'}


def test_a_part_without_a_result_fails(monkeypatch, capsys):
    def broken():
        yield AT.holds('so it is', True)
        raise NoOrbit('no orbit was found')

    only(monkeypatch, 'rashidi', broken)
    code, rows = outcome(capsys, 'rashidi')
    assert code == 1
    assert [row['verdict'] for row in rows] == ['agrees', 'FAILS']
    assert 'no orbit was found' in rows[1]['computed']


@pytest.mark.parametrize('arguments', [
    ['--paper', 'nobody'], ['--jobs', '0'], ['--json'], ['--what'], ['--json', '/dev'],
    ['--html', '/dev/null/page.html'], ['spare']])
def test_wrong_arguments_end_with_one_line(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        sys.exit(reproduce.main(arguments))
    assert ended.value.code == 2
    said = capsys.readouterr()
    assert said.out == ''
    assert said.err.startswith('reproduce: ') and said.err.count('\n') == 1


def test_it_is_installed_as_an_executable():
    setup = (Path(__file__).parents[3] / 'setup.py').read_text()
    assert 'reproduce = cpg_ros.ros.cli.executables:reproduce' in setup


def test_groups_are_those_known():
    # D4 has ten subgroups; 8! / 2!^4 / 4! = 105 ways to pair eight cells.
    assert len(buono_gaits.D4) == 8
    assert len(buono_gaits.all_subgroups(buono_gaits.D4)) == 10
    assert sum(1 for _ in buono_gaits._pairings(tuple(range(8)))) == 105
