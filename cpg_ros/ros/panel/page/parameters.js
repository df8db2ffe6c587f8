// A control for each parameter, made from its descriptor: gaits as buttons, ranges as sliders.

const SEND_PERIOD = 80;  // ms between two values of a slider that is dragged

const make = (kind, properties = {}, ...children) => {
  const made = Object.assign(document.createElement(kind), properties);
  made.append(...children);
  return made;
};

// A preset's name for people: goat_walk is goat walk, liu2024_walk is walk (Liu 2024).
const title = (name) => name.replace(/^([a-z])([a-z]*)(\d{4})_(.*)$/, (_, first, rest, year, gait) =>
  `${gait} (${first.toUpperCase()}${rest} ${year})`).replaceAll('_', ' ');

const rounded = (value) => typeof value === 'number' ? String(+value.toPrecision(6)) : value;

export class Parameters {
  constructor(set) {
    this.set = set;
    this.place = document.getElementById('parameters');
    this.gaits = document.getElementById('gaits');
    this.presets = document.getElementById('presets');
    this.field = document.getElementById('find');
    this.field.oninput = () => this.find(this.field.value);
    this.members = [];  // group, element and words of each parameter
    this.byName = {};
    this.shown = {};
    this.gaitNames = [];  // without presets of other names
  }

  show(controls) {
    this.byName = Object.fromEntries(controls.map((parameter) => [parameter.name, parameter]));
    this.shown = {};
    const groups = {}, fixed = [];
    this.members = [];
    for (const parameter of controls) {
      if (parameter.name === 'gait' && parameter.choices.length) continue;
      if (parameter.fixed) fixed.push(parameter);
      else (groups[parameter.name.includes('.') ? parameter.name.split('.')[0] : 'general'] ??= []).push(parameter);
    }
    this.place.replaceChildren(
      ...Object.entries(groups).map(([name, members]) => this.group(name, members,
        (parameter) => this.control(parameter))),
      this.group('read-only while the node runs', fixed, (parameter) => make('div',
        { className: 'parameter' }, make('span', { textContent: parameter.name }),
        make('output', { className: 'all', textContent: String(parameter.value) || '–' }), make('p', { textContent: parameter.text }))));
    this.find(this.field.value);
    const names = this.byName.gait?.choices || [];
    const presets = this.byName.gait?.presets || [], untuned = this.byName.gait?.untuned || [];
    this.gaitNames = names.filter((name) => !presets.includes(name));
    const button = (gait, k) => {
      const made = make('button', { textContent: title(gait), onclick: () => this.set('gait', gait) });
      made.dataset.gait = gait;
      if (untuned.includes(gait)) Object.assign(made, { className: 'untuned', title: 'not tuned for this robot' });
      if (k < 9) made.append(make('kbd', { textContent: k + 1 }));
      return made;
    };
    this.gaits.replaceChildren(...this.gaitNames.map(button));
    this.presets.replaceChildren(...presets.map((preset) => button(preset, Infinity)));
    document.getElementById('preset-group').hidden = !presets.length;
    this.markGait(this.byName.gait?.value);
  }

  group(name, members, control) {
    const made = make('details', {}, make('summary', { textContent: `${name} ` },
      make('small', { textContent: members.length })));
    for (const parameter of members) {
      const element = control(parameter);
      this.members.push({ group: made, element, words: `${parameter.name} ${parameter.text}`.toLowerCase() });
      made.append(element);
    }
    return made;
  }

  // Show the parameters whose names or descriptions have all words; with none, the closed groups.
  find(text) {
    const query = text.toLowerCase().split(/\s+/).filter(Boolean), matches = new Set();
    for (const { group, element, words } of this.members) {
      element.hidden = !query.every((word) => words.includes(word));
      if (!element.hidden) matches.add(group);
    }
    for (const group of this.place.children) {
      group.hidden = !matches.has(group);
      if (query.length) group.open = true;
      else if (this.searched) group.open = false;
    }
    this.searched = query.length > 0;
  }

  control(parameter) {
    const labelled = (kind, properties, ...children) => {
      const input = make(kind, properties, ...children);
      input.setAttribute('aria-label', parameter.name);
      input.dataset.parameter = parameter.name;
      return input;
    };
    const number = (text) => parameter.kind === 'integer' ? Math.round(text) : Number(text);
    let input, slider = null, show = (value) => { input.value = value; };
    if (parameter.kind === 'bool') {
      input = labelled('input', { type: 'checkbox', className: 'all',
        onchange: () => this.set(parameter.name, input.checked) });
      show = (value) => { input.checked = value; };
    } else if (parameter.kind === 'text') {
      input = labelled(...parameter.choices.length ? ['select', {}, ...parameter.choices.map((word) => new Option(word))]
        : ['input', { type: 'text' }]);
      input.className = 'all';
      input.onchange = () => this.set(parameter.name, input.value);
    } else {
      input = labelled('input', { type: 'number', step: 'any',
        onchange: () => this.set(parameter.name, number(input.value)) });
      if (parameter.low !== null && parameter.high !== null) slider = this.slider(parameter, labelled, number, input);
      else input.className = 'all';
      show = (value) => {
        input.value = rounded(value);
        if (slider && !slider.dataset.held) slider.value = value;
      };
    }
    this.shown[parameter.name] = show;
    show(parameter.value);
    const label = parameter.name.includes('.') ? parameter.name.slice(parameter.name.indexOf('.') + 1) : parameter.name;
    const range = slider ? ` (${rounded(parameter.low)} to ${rounded(parameter.high)}${parameter.unit && ` ${parameter.unit}`})` : '';
    return make('label', { className: 'parameter' },
      make('span', { textContent: label + (parameter.unit ? ` [${parameter.unit}]` : '') }),
      ...slider ? [slider] : [], input, make('p', { textContent: parameter.text + range }));
  }

  // A slider beside the field of a number: while it is dragged, a value every EVERY ms.
  slider(parameter, labelled, number, input) {
    let sent = 0, timer = 0;
    const slider = labelled('input', { type: 'range', min: parameter.low, max: parameter.high,
      step: parameter.kind === 'integer' ? 1 : (parameter.high - parameter.low) / 2000 });
    const send = () => {
      clearTimeout(timer);
      sent = performance.now();
      this.set(parameter.name, number(slider.value));
    };
    slider.oninput = () => {
      input.value = rounded(number(slider.value));
      slider.dataset.held = 'yes';
      clearTimeout(timer);
      timer = setTimeout(send, Math.max(0, SEND_PERIOD - (performance.now() - sent)));
    };
    slider.onchange = () => {
      delete slider.dataset.held;
      send();
    };
    return slider;
  }

  update(values) {
    for (const [name, value] of Object.entries(values)) {
      if (!this.byName[name]) continue;
      this.byName[name].value = value;
      this.shown[name]?.(value);
      if (name === 'gait') this.markGait(value);
    }
  }

  // After a refusal, every control shows the node's own value again.
  restore() {
    for (const [name, show] of Object.entries(this.shown)) show(this.byName[name].value);
  }

  markGait(gait) {
    for (const button of [...this.gaits.children, ...this.presets.children]) {
      button.classList.toggle('on', button.dataset.gait === gait);
      button.setAttribute('aria-pressed', button.dataset.gait === gait);
    }
  }
}
