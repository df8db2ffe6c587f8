// A control for each parameter, made from its descriptor: gaits as buttons, ranges as sliders.

const EVERY = 80;  // ms between two values of a slider that is dragged

const make = (kind, properties = {}, ...children) => {
  const made = Object.assign(document.createElement(kind), properties);
  made.append(...children);
  return made;
};

// A preset's name for people: goat_walk is goat walk, liu2024_walk is walk (Liu 2024).
const titled = (name) => name.replace(/^([a-z])([a-z]*)(\d{4})_(.*)$/, (_, first, rest, year, gait) =>
  `${gait} (${first.toUpperCase()}${rest} ${year})`).replaceAll('_', ' ');

const short = (value) => typeof value === 'number' ? String(+value.toPrecision(6)) : value;

export class Parameters {
  constructor(set) {
    this.set = set;
    this.place = document.getElementById('parameters');
    this.gaits = document.getElementById('gaits');
    this.presets = document.getElementById('presets');
    this.field = document.getElementById('find');
    this.field.oninput = () => this.find(this.field.value);
    this.members = [];  // group, element and words of each parameter
    this.known = {};
    this.shown = {};
    this.gaitNames = [];  // without presets of other names
  }

  show(controls) {
    this.known = Object.fromEntries(controls.map((one) => [one.name, one]));
    this.shown = {};
    const groups = {}, fixed = [];
    this.members = [];
    for (const one of controls) {
      if (one.name === 'gait' && one.choices.length) continue;
      if (one.fixed) fixed.push(one);
      else (groups[one.name.includes('.') ? one.name.split('.')[0] : 'general'] ??= []).push(one);
    }
    this.place.replaceChildren(
      ...Object.entries(groups).map(([name, members]) => this.group(name, members,
        (one) => this.control(one))),
      this.group('read-only while the node runs', fixed, (one) => make('div',
        { className: 'parameter' }, make('span', { textContent: one.name }),
        make('output', { className: 'all', textContent: String(one.value) || '–' }), make('p', { textContent: one.text }))));
    this.find(this.field.value);
    const words = this.known.gait?.choices || [];
    const presets = this.known.gait?.presets || [], untuned = this.known.gait?.untuned || [];
    this.gaitNames = words.filter((word) => !presets.includes(word));
    const button = (gait, k) => {
      const made = make('button', { textContent: titled(gait), onclick: () => this.set('gait', gait) });
      made.dataset.gait = gait;
      if (untuned.includes(gait)) Object.assign(made, { className: 'untuned', title: 'not tuned for this robot' });
      if (k < 9) made.append(make('kbd', { textContent: k + 1 }));
      return made;
    };
    this.gaits.replaceChildren(...this.gaitNames.map(button));
    this.presets.replaceChildren(...presets.map((preset) => button(preset, Infinity)));
    document.getElementById('preset-group').hidden = !presets.length;
    this.mark(this.known.gait?.value);
  }

  group(name, members, control) {
    const made = make('details', {}, make('summary', { textContent: `${name} ` },
      make('small', { textContent: members.length })));
    for (const one of members) {
      const element = control(one);
      this.members.push({ group: made, element, words: `${one.name} ${one.text}`.toLowerCase() });
      made.append(element);
    }
    return made;
  }

  // Show the parameters whose names or descriptions have all words; with none, the closed groups.
  find(text) {
    const wanted = text.toLowerCase().split(/\s+/).filter(Boolean), found = new Set();
    for (const { group, element, words } of this.members) {
      element.hidden = !wanted.every((word) => words.includes(word));
      if (!element.hidden) found.add(group);
    }
    for (const group of this.place.children) {
      group.hidden = !found.has(group);
      if (wanted.length) group.open = true;
      else if (this.searched) group.open = false;
    }
    this.searched = wanted.length > 0;
  }

  control(one) {
    const named = (kind, properties, ...children) => {
      const input = make(kind, properties, ...children);
      input.setAttribute('aria-label', one.name);
      input.dataset.parameter = one.name;
      return input;
    };
    const number = (text) => one.kind === 'integer' ? Math.round(text) : Number(text);
    let input, slider = null, show = (value) => { input.value = value; };
    if (one.kind === 'bool') {
      input = named('input', { type: 'checkbox', className: 'all',
        onchange: () => this.set(one.name, input.checked) });
      show = (value) => { input.checked = value; };
    } else if (one.kind === 'text') {
      input = named(...one.choices.length ? ['select', {}, ...one.choices.map((word) => new Option(word))]
        : ['input', { type: 'text' }]);
      input.className = 'all';
      input.onchange = () => this.set(one.name, input.value);
    } else {
      input = named('input', { type: 'number', step: 'any',
        onchange: () => this.set(one.name, number(input.value)) });
      if (one.low !== null && one.high !== null) slider = this.slider(one, named, number, input);
      else input.className = 'all';
      show = (value) => {
        input.value = short(value);
        if (slider && !slider.dataset.held) slider.value = value;
      };
    }
    this.shown[one.name] = show;
    show(one.value);
    const label = one.name.includes('.') ? one.name.slice(one.name.indexOf('.') + 1) : one.name;
    const range = slider ? ` (${short(one.low)} to ${short(one.high)}${one.unit && ` ${one.unit}`})` : '';
    return make('label', { className: 'parameter' },
      make('span', { textContent: label + (one.unit ? ` [${one.unit}]` : '') }),
      ...slider ? [slider] : [], input, make('p', { textContent: one.text + range }));
  }

  // A slider beside the field of a number: while it is dragged, a value every EVERY ms.
  slider(one, named, number, input) {
    let sent = 0, timer = 0;
    const slider = named('input', { type: 'range', min: one.low, max: one.high,
      step: one.kind === 'integer' ? 1 : (one.high - one.low) / 2000 });
    const send = () => {
      clearTimeout(timer);
      sent = performance.now();
      this.set(one.name, number(slider.value));
    };
    slider.oninput = () => {
      input.value = short(number(slider.value));
      slider.dataset.held = 'yes';
      clearTimeout(timer);
      timer = setTimeout(send, Math.max(0, EVERY - (performance.now() - sent)));
    };
    slider.onchange = () => {
      delete slider.dataset.held;
      send();
    };
    return slider;
  }

  take(values) {
    for (const [name, value] of Object.entries(values)) {
      if (!this.known[name]) continue;
      this.known[name].value = value;
      this.shown[name]?.(value);
      if (name === 'gait') this.mark(value);
    }
  }

  // After a refusal, every control shows the node's own value again.
  restore() {
    for (const [name, show] of Object.entries(this.shown)) show(this.known[name].value);
  }

  mark(gait) {
    for (const button of [...this.gaits.children, ...this.presets.children]) {
      button.classList.toggle('on', button.dataset.gait === gait);
      button.setAttribute('aria-pressed', button.dataset.gait === gait);
    }
  }
}
