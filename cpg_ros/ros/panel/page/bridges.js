// The bridges to real robots: state, battery and temperature of each, and its two stops.

export class Bridges {
  constructor(send) {
    this.send = send;
    this.section = document.getElementById('bridges');
    this.parts = {};
  }

  // Elements stay while their bridge does: a button that is replaced loses a click.
  add(name) {
    const box = this.section.querySelector('template').content.firstElementChild.cloneNode(true);
    box.querySelector('strong').textContent = name;
    for (const button of box.querySelectorAll('button'))
      button.onclick = () => this.send({ do: button.dataset.action, bridge: name });
    this.section.append(box);
    return box;
  }

  update({ bridges }) {
    for (const [name, box] of Object.entries(this.parts)) {
      if (bridges[name]) continue;
      box.remove();
      delete this.parts[name];
    }
    for (const [name, { state, level, text, battery, hottest }] of Object.entries(bridges)) {
      const box = this.parts[name] ||= this.add(name);
      const [shown, charge, heat] = box.querySelectorAll('span');
      shown.textContent = level === 'stale' ? 'stale' : state;
      shown.className = `chip ${level}`;
      charge.textContent = battery === null ? '' : `battery ${battery} %`;
      heat.textContent = hottest ? `${hottest[0]} °C (${hottest[1]})` : '';
      box.querySelector('p').textContent = text === state ? '' : text.replace(`${state}: `, '');
    }
    this.section.hidden = !Object.keys(bridges).length;
  }
}
