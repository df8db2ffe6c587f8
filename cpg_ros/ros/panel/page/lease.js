// Who has control of the robot, and the click that takes it over.

const byId = (id) => document.getElementById(id);
const listFormat = new Intl.ListFormat('en-GB');

export class Lease {
  now = null;

  // Whether this page may steer, or would by its first command.
  get steers() {
    const { now } = this;
    return !!now && !now.stop_only && (now.yours || !now.holder) && now.confirmed;
  }

  get onlyWatches() {
    return !!this.now && (this.now.stop_only || (!!this.now.holder && !this.now.yours));
  }

  // Why the robot does not move as steered, '' if it does.
  get reason() {
    return !this.now || (this.steers && this.now.round_trip === null) ? '' : this.lines().at(-1);
  }

  lines() {
    const { now } = this, lines = [];
    const holder = now.holder.replace(/^p/, 'P');
    if (now.stop_only) return ['16 pages are already open: this one can only stop the robot. '
      + 'It gets full access when another page closes.'];
    if (now.yours) lines.push('This page has control.');
    else if (!now.holder) lines.push('No page has control. The first command takes it.');
    else if (now.lost_to === now.holder) lines.push(`${holder} took over. This page only watches.`);
    else lines.push(`${holder} has control. This page only watches.`);
    if (now.others.length) {
      lines.push(`cmd_vel is also published by ${listFormat.format(now.others)}${now.confirmed
        ? ': both steer.' : '. To steer, take over.'}`);
    }
    if (now.round_trip !== null) {
      lines.push(`Link too slow to steer: ${now.round_trip.toFixed(1)} s (limit ${now.limit} s).`);
    }
    return lines;
  }

  update(message) {
    this.now = message;
    const others = message.others.length > 0 && !message.confirmed;
    // Whoever is alone has nobody to share control with.
    byId('control').hidden = message.pages < 2 && !message.stop_only && !message.others.length
      && message.round_trip === null;
    byId('control').className = message.yours ? 'yours' : this.onlyWatches ? 'other' : '';
    byId('control').classList.toggle('warn', others || message.round_trip !== null);
    byId('this-page').textContent = `this is ${message.page}`;
    byId('holder').replaceChildren(...this.lines().map((textContent) =>
      Object.assign(document.createElement('p'), { textContent })));
    byId('take-over').hidden = message.stop_only || !(this.onlyWatches || others);
    byId('release').hidden = !message.yours;
    document.body.classList.toggle('watching', this.onlyWatches);
  }
}
