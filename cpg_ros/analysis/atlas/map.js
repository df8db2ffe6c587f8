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
  document.getElementById('preset').textContent = `network: ${A.network}\npresets:\n  my_${
    pick.value}:\n    gait: ${pick.value}\n    parameters: {${
    Object.entries(set).map(([n, v]) => `${n}: ${v}`).join(', ')}}\n`;
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
