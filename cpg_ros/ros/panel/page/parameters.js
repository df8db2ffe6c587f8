// A control for each parameter, made from its descriptor: gaits as buttons, ranges as sliders.

const EVERY = 80;  // ms between two values of a slider that is dragged

const make = (kind, properties = {}, ...children) => {
  const made = Object.assign(document.createElement(kind), properties);
  made.append(...children);
  return made;
};

export const short = (value) => typeof value === 'number' ? String(+value.toPrecision(6)) : value;

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
        { className: 'parameter' }, make('div', { className: 'name' },
          make('span', { textContent: one.name }),
          make('output', { textContent: String(one.value) || '–' })),
        make('p', { textContent: one.text }))));
    this.find(this.field.value);
    const words = this.known.gait?.choices || [];
    const presets = this.known.gait?.presets || [];
    this.gaitNames = words.filter((word) => !presets.includes(word));
    const button = (gait, k) => {
      const made = make('button', { textContent: gait, onclick: () => this.set('gait', gait) });
      made.dataset.gait = gait;
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
    const named = (input) => {
      input.setAttribute('aria-label', one.name);
      input.dataset.parameter = one.name;
      return input;
    };
    const parts = [], about = make('p', { textContent: one.text });
    let input;
    if (one.kind === 'bool') {
      input = named(make('input', { type: 'checkbox', checked: one.value }));
      input.onchange = () => this.set(one.name, input.checked);
      parts.push((value) => { input.checked = value; });
    } else if (one.kind === 'text') {
      const listed = one.choices.length > 0;
      input = named(listed ? make('select', {}, ...one.choices.map((word) => new Option(word)))
        : make('input', { type: 'text' }));
      input.onchange = () => this.set(one.name, input.value);
      parts.push((value) => { input.value = value; });
    } else {
      const number = (text) => one.kind === 'integer' ? Math.round(text) : Number(text);
      input = named(make('input', { type: 'number', step: 'any' }));
      input.onchange = () => this.set(one.name, number(input.value));
      parts.push((value) => { input.value = short(value); });
      if (one.low !== null && one.high !== null) {
        const slider = named(make('input', { type: 'range', min: one.low, max: one.high,
          step: one.kind === 'integer' ? 1 : (one.high - one.low) / 2000 }));
        let sent = 0, timer = 0;
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
        parts.push((value) => {
          if (!slider.dataset.held) slider.value = value;
        });
        about.append(make('span', { className: 'span' },
          make('span', { textContent: `${short(one.low)} ${one.unit}` }),
          make('span', { textContent: `${short(one.high)} ${one.unit}` })));
        about.prepend(slider);
      }
    }
    this.shown[one.name] = (value) => parts.forEach((part) => part(value));
    this.shown[one.name](one.value);
    const label = one.name.includes('.') ? one.name.slice(one.name.indexOf('.') + 1) : one.name;
    return make('div', { className: 'parameter' }, make('label', { className: 'name' },
      make('span', { textContent: label + (one.unit ? ` [${one.unit}]` : '') }), input), about);
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
