// The bridges to real robots: state, battery and temperature of each, and its two stops.

const make = (tag, more = {}) => Object.assign(document.createElement(tag), more);

export class Bridges {
  constructor(send) {
    this.send = send;
    this.section = document.getElementById('bridges');
    this.parts = {};
  }

  // Elements stay while their bridge does: a button that is replaced loses a click.
  add(name) {
    const part = { box: make('div', { className: 'bridge' }), state: make('span'), text: make('p'),
      battery: make('span'), hottest: make('span') };
    const button = (action, textContent, title) => make('button', { className: 'danger',
      textContent, title, onclick: () => this.send({ do: action, bridge: name }) });
    const head = make('div', { className: 'buttons' }), stops = head.cloneNode();
    head.append(make('strong', { textContent: name }), part.state, part.battery, part.hottest);
    stops.append(button('sit', 'Sit down', 'the robot sits down, and its motors are damped then'),
      button('damp', 'Damp at once', 'the motors only brake, at once: a robot that stands sinks'));
    part.text.className = 'note';
    part.box.append(head, part.text, stops);
    this.section.append(part.box);
    return part;
  }

  take({ bridges }) {
    for (const name of Object.keys(this.parts)) {
      if (bridges[name]) continue;
      this.parts[name].box.remove();
      delete this.parts[name];
    }
    for (const [name, bridge] of Object.entries(bridges)) {
      const part = this.parts[name] ||= this.add(name), { state, level, text } = bridge;
      part.state.textContent = level === 'stale' ? 'stale' : state;
      part.state.className = `chip ${level}`;
      part.text.textContent = text === state ? '' : text.replace(`${state}: `, '');
      part.battery.textContent = bridge.battery === null ? '' : `battery ${bridge.battery} %`;
      part.hottest.textContent = bridge.hottest
        ? `${bridge.hottest[0]} °C (${bridge.hottest[1]})` : '';
    }
    this.section.hidden = !Object.keys(bridges).length;
  }
}
