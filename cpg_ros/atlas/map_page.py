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

"""An atlas as one page that needs no other file: a click shows what runs there."""

import base64
import json
from pathlib import Path
from typing import Any

from cpg_ros.atlas.chart import Chart
from cpg_ros.atlas.codimension_two import LABELS
from cpg_ros.atlas.grid_refinement import Sheet
from cpg_ros.atlas.hopf_curves import Boundary
from cpg_ros.atlas.map_picture import LINES, markers, STATES
from cpg_ros.files.atomic_write import write_atomically
from cpg_ros.files.page_style import STYLE
from cpg_ros.networks.registry import find_network
import numpy as np

#: Points of a waveform on the page, and distance on the grid between two that are there.
POINTS, APART = 32, 4
#: Numbers of a point that the page has.
SHOWN = ('period', 'amplitude', 'leading', 'lock', 'basin')

MORE = """
body { max-width: 90em; } main { display: flex; flex-wrap: wrap; gap: 2em; }
canvas { border: 1px solid #cbd5e0; display: block; max-width: 100%; }
#map { cursor: crosshair; } select { font: inherit; } pre { background: #f7fafc; padding: 0.8em; }
button { font: inherit; } aside { flex: 1; min-width: 22em; } .key span { display: inline-block;
width: 1em; height: 1em; vertical-align: -0.15em; margin: 0 0.3em 0 1em; }
"""
SCRIPT = """
const A = JSON.parse(document.getElementById('atlas').textContent);
const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));
const floats = text => new Float32Array(bytes(text).buffer);
for (const g of Object.values(A.gaits)) {
  g.label = bytes(g.label);
  for (const n of A.shown) g[n] = floats(g[n]);
}
const [N, M] = A.counts, map = document.getElementById('map'), pen = map.getContext('2d');
const L = 52, B = 36, W = map.width - L - 8, H = map.height - B - 8;
const pick = document.getElementById('gait');
for (const g of Object.keys(A.gaits)) pick.add(new Option(g, g));
const X = v => L + W * (v - A.low[0]) / (A.high[0] - A.low[0]);
const Y = v => 8 + H * (1 - (v - A.low[1]) / (A.high[1] - A.low[1]));
let at = null;
function draw() {
  const g = A.gaits[pick.value];
  pen.clearRect(0, 0, map.width, map.height);
  for (let i = 0; i < N; i++) for (let j = 0; j < M; j++) {
    pen.fillStyle = A.colours[g.label[i * M + j]];
    pen.fillRect(L + W * (i - 0.5) / (N - 1), 8 + H * (1 - (j + 0.5) / (M - 1)),
                 W / (N - 1) + 1, H / (M - 1) + 1);
  }
  pen.clearRect(0, 0, L, map.height); pen.clearRect(0, 8 + H, map.width, B);
  pen.clearRect(0, 0, map.width, 8); pen.clearRect(L + W, 0, 8, map.height);
  for (const c of A.curves) if (c.gaits.includes(pick.value)) {
    pen.strokeStyle = A.lines[c.kind]; pen.lineWidth = 1.5; pen.beginPath();
    c.points.forEach((p, k) => pen[k ? 'lineTo' : 'moveTo'](X(p[0]), Y(p[1])));
    pen.stroke();
  }
  pen.font = '11px system-ui'; pen.lineWidth = 1.2; pen.strokeStyle = '#1a202c';
  for (const [x, y, text] of A.gaits[pick.value].special) {
    const wide = pen.measureText(text).width, left = X(x) + 8 + wide > L + W;
    pen.fillStyle = '#ffffffc0';
    pen.fillRect(X(x) + (left ? -8 - wide : 5), Y(y) - 14, wide + 3, 12);
    pen.fillStyle = '#fff'; pen.beginPath(); pen.arc(X(x), Y(y), 4, 0, 7); pen.fill();
    pen.stroke(); pen.fillStyle = '#1a202c';
    pen.fillText(text, X(x) + (left ? -7 - wide : 6), Y(y) - 4);
  }
  pen.fillStyle = '#1a202c'; pen.font = '12px system-ui';
  for (let k = 0; k <= 4; k++) {
    const [u, v] = [0, 1].map(a => A.low[a] + (A.high[a] - A.low[a]) * k / 4);
    pen.fillText(+u.toPrecision(3), X(u) - 10, map.height - 18);
    pen.fillText(+v.toPrecision(3), 18, Y(v) + 4);
  }
  pen.fillText(A.names[0], L + W / 2, map.height - 4);
  pen.save(); pen.translate(11, 8 + H / 2); pen.rotate(-Math.PI / 2);
  pen.fillText(A.names[1], 0, 0); pen.restore();
  if (at) { pen.strokeStyle = '#000'; pen.strokeRect(X(at[0]) - 4, Y(at[1]) - 4, 8, 8); }
}
function wave(g, i, j) {
  let best = null, gap = 1e9;
  for (const w of g.waves) {
    const d = Math.abs(w[0] - i) + Math.abs(w[1] - j);
    if (d < gap) { gap = d; best = w; }
  }
  return best;
}
function show(i, j) {
  const g = A.gaits[pick.value], k = i * M + j;
  const value = a => A.low[a] + (A.high[a] - A.low[a]) * [i / (N - 1), j / (M - 1)][a];
  at = [value(0), value(1)];
  const rows = [[A.names[0], at[0]], [A.names[1], at[1]], ['state', A.states[g.label[k]]]];
  if (g.label[k]) for (const n of A.shown) rows.push([n, g[n][k]]);
  document.getElementById('values').innerHTML = rows.map(
    ([n, v]) => `<tr><td>${n}</td><td class="value">${
    typeof v !== 'number' ? v : isNaN(v) ? 'not computed' : +v.toPrecision(5)}</td></tr>`
  ).join('');
  const c = document.getElementById('waves'), p = c.getContext('2d');
  p.clearRect(0, 0, c.width, c.height);
  const set = {...A.base};
  A.lines_of.forEach((line, a) => line.forEach(([n, s]) => {
    set[n] = +(s * at[a]).toPrecision(8);
  }));
  document.getElementById('preset').textContent = `network: ${A.network}\\npresets:\\n  my_${
    pick.value}:\\n    gait: ${pick.value}\\n    parameters: {${
    Object.entries(set).map(([n, v]) => `${n}: ${v}`).join(', ')}}\\n`;
  const w = g.label[k] ? wave(g, i, j) : null;
  if (w) A.legs.forEach(([leg, cell], r) => {
    const y = w[2][cell], top = Math.max(...w[2].flat().map(Math.abs)) || 1, n = y.length;
    const h = c.height / A.legs.length, u = (c.width - 40) / (2 * n);
    p.fillStyle = '#2b6cb0'; p.strokeStyle = '#1a202c'; p.font = '12px system-ui';
    for (let m = 0; m < 2 * n; m++) if (y[m % n] < 0)
      p.fillRect(40 + u * m, h * (r + 0.86), u + 1, h * 0.1);
    p.beginPath();
    for (let m = 0; m <= 2 * n; m++)
      p[m ? 'lineTo' : 'moveTo'](40 + u * m, h * (r + 0.42 - 0.36 * y[m % n] / top));
    p.stroke(); p.fillText(leg, 4, h * (r + 0.5));
  });
  draw();
}
map.addEventListener('click', e => {
  const box = map.getBoundingClientRect(), s = map.width / box.width;
  const clamp = (v, n) => Math.max(0, Math.min(n - 1, Math.round(v)));
  show(clamp(((e.clientX - box.left) * s - L) / W * (N - 1), N),
       clamp((1 - ((e.clientY - box.top) * s - 8) / H) * (M - 1), M));
});
pick.addEventListener('change', () => {
  const i = at && Math.round((at[0] - A.low[0]) / (A.high[0] - A.low[0]) * (N - 1));
  const j = at && Math.round((at[1] - A.low[1]) / (A.high[1] - A.low[1]) * (M - 1));
  at ? show(i, j) : draw();
});
document.getElementById('copy').addEventListener('click', () =>
  navigator.clipboard.writeText(document.getElementById('preset').textContent));
draw();
"""


def _packed(values: np.ndarray) -> str:
    return base64.b64encode(values.tobytes()).decode('ascii')


def _waves(sheet: Sheet, cells: int) -> list[Any]:
    """Row, column and cells over a cycle, of some points of the grid."""
    found, seen = [], set()
    for (row, column), (wave, _) in sorted(sheet.waves.items()):
        place = row // APART, column // APART
        if place in seen:
            continue
        seen.add(place)
        x = np.array(wave)[:, :cells]
        some = x[::max(1, len(x) // POINTS)]
        found.append([row, column, np.round(some - x.mean(axis=0), 3).T.tolist()])
    return found


def write_page(path: Path, chart: Chart, sheets: dict[str, Sheet], curves: list[Boundary]) -> Path:
    """Write the page and return its path.

    Raises:
        OSError: it cannot be written.

    """
    kind = find_network(chart.network)
    legs = next(iter(kind.legs.values()))
    axes = (chart.first, chart.second)
    atlas = {
        'network': chart.network,
        'names': [str(axis.line) for axis in axes], 'low': [axis.low for axis in axes],
        'high': [axis.high for axis in axes], 'counts': [axis.count for axis in axes],
        'lines_of': [list(zip(axis.line.names, axis.line.signs, strict=True)) for axis in axes],
        'base': chart.base, 'shown': SHOWN,
        'states': list(STATES), 'colours': list(STATES.values()),
        'lines': {name: line[0] for name, line in LINES.items()},
        'legs': [[leg, cells[0] - 1] for leg, cells in legs.items()],
        'curves': [{'kind': one.kind, 'gaits': one.gaits,
                    'points': np.round(one.points[:, :2], 5).tolist()} for one in curves],
        'gaits': {gait: {
            'label': _packed(sheet.label.astype(np.uint8)),
            **{name: _packed(sheet.numbers[name].astype(np.float32)) for name in SHOWN},
            'special': [[*place, ' '.join(labels)]
                        for place, labels in markers(chart, curves, gait)],
            'waves': _waves(sheet, max(max(cells) for cells in legs.values()))}
            for gait, sheet in sheets.items()}}
    data = json.dumps(atlas).replace('<', '\\u003c')
    kinds = {curve.kind for curve in curves}
    met = {kind: colour for kind, (colour, _) in LINES.items() if kind in kinds}
    key = ''.join(f'<span style="background:{colour}"></span>{text}'
                  for text, colour in (STATES | met).items())
    listed = ''.join(
        f'<tr><td>{LABELS[point.kind]}</td><td>{point}</td></tr>'
        for point in {str(point): point for curve in curves
                      for point in curve.codimension_two if point.gait in sheets}.values())
    special = (f'<h2>Points of codimension two</h2><table>{listed}</table>' if listed else '')
    title = f'Gaits of the {kind.name} network over {axes[0].line} and {axes[1].line}'
    write_atomically(path, f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<style>{STYLE}{MORE}</style></head><body><h1>{title}</h1>
<p>Gait <select id="gait" aria-label="gait"></select>. Click the map to see what the network
does there: the waveform of each leg's first cell over two cycles, with bars where it is below its
mean, and the parameters.</p><p class="key">{key}</p>
<main><canvas id="map" width="760" height="600"></canvas>
<aside><table id="values"></table><canvas id="waves" width="480" height="280"></canvas>
<p><button id="copy">Copy the preset</button></p><pre id="preset"></pre></aside></main>
{special}
<script type="application/json" id="atlas">{data}</script><script>{SCRIPT}</script></body></html>
""")
    return path
